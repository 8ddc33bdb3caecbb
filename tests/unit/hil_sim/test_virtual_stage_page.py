"""docs/how-to/virtual-stage.md names the modes, homing methods and fixtures that there are."""

import re
from pathlib import Path

from hil_sim.cia402.homing import METHODS
from hil_sim.cia402.modes import ModeCode

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "virtual-stage.md").read_text(encoding="utf-8")


def test_modes_and_homing_methods_are_those_of_the_drive():
    (row,) = re.findall(r"^\| modes \| (.*) \|$", PAGE, re.M)
    modes, methods = row.split(" with methods ")
    assert {int(code) for code in re.findall(r"\((\d+)\)", modes)} == set(ModeCode) - {0}
    assert {int(method) for method in methods.split(", ")} == set(METHODS)


def test_fixtures_are_those_of_the_plugin():
    plugin = (ROOT / "stagectl" / "pytest_plugin.py").read_text(encoding="utf-8")
    defined = set(re.findall(r"@pytest\.fixture.*\ndef (\w+)", plugin))
    table = PAGE.partition("| fixture | gives |")[2].partition("\n\n")[0]
    first = [row.split("|")[1] for row in table.splitlines() if row.startswith("|")]
    assert {name for cell in first for name in re.findall(r"`(\w+)`", cell)} == defined
