"""Every benchmark still imports what it needs and says how to call it; none is run."""

import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
COMMANDS = sorted(p.name for p in FOLDER.glob("*.py") if "__main__" in p.read_text())


@pytest.mark.parametrize("name", COMMANDS)
def test_it_says_what_it_does(name, monkeypatch, capsys):
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    main = runpy.run_path(str(FOLDER / name))["main"]
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    usage, _, about = capsys.readouterr().out.partition("\n\n")
    assert usage.startswith(f"usage: {name}")
    assert not about.startswith("options:")


def test_they_are_found():
    assert len(COMMANDS) > 10
