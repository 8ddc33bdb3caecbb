"""Every benchmark still imports what it needs and says how to call it; none is run."""

import importlib
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "benchmarks").glob("*/*.py"))
COMMANDS = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in SCRIPTS
    if "__main__" in path.read_text()
]


@pytest.mark.parametrize("name", COMMANDS)
def test_it_says_what_it_does(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        importlib.import_module(name).main()
    assert ended.value.code == 0
    usage, _, about = capsys.readouterr().out.partition("\n\n")
    assert usage.startswith(f"usage: {name}")
    assert not about.startswith("options:")


def test_those_that_a_page_names_exist():
    for page in (ROOT / "Makefile", ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        assert set(re.findall(r"-m\s(benchmarks[\w.]*)", page.read_text())) <= set(COMMANDS), page


def test_the_table_has_them_all():
    table = (ROOT / "benchmarks" / "README.md").read_text()
    assert set(COMMANDS) == {f"benchmarks.{n}" for n in re.findall(r"^\| `([\w.]+)`", table, re.M)}
