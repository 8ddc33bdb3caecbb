"""Effects as users meet them: listed and described."""

import json
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "sim-to-real.md"


def test_the_page_holds_the_table_that_the_command_prints(stagectl):
    done = stagectl("effects", "--markdown")
    page = PAGE.read_text(encoding="utf-8")
    table = page.partition("<!-- effects -->\n")[2].partition("<!-- /effects -->")[0]
    assert done.stdout == table
    assert table.count("\n") >= 2 + 21


def test_an_effect_is_described(stagectl):
    done = stagectl("effects", "base_motion", "--json", "-")
    (effect,) = json.loads(done.stdout)
    assert [p["key"] for p in effect["parameters"]] == ["frequency", "damping", "mass_ratio"]
    assert effect["parameters"][0]["usual"] == [5.0, 30.0]
    words = stagectl("effects", "base_motion").stdout
    assert "isolators" in words
    assert effect["remedy"][:20] in words
    missing = stagectl("effects", "base_moton")
    assert missing.returncode == 2
    assert "did you mean 'base_motion'?" in missing.stderr
