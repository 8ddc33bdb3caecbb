"""Maps on a terminal: figures, places, versions and changes."""

from dataclasses import replace

import numpy as np
import pytest

from stagectl.history import Activation
from stagectl.maps import compare
from stagectl.maps.output import changes_sections, map_outline
from stagectl.maps.output.outline import at_place, day, versions_sections
from stagectl.report import print_outline, print_sections
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, level
from tests.unit.stagectl.printed import printed


def test_times_are_in_utc():
    assert day(1.7e9) == "2023-11-14 22:13"


def test_there_is_a_row_for_each_axis_and_for_each_figure_that_is_known(mapped):
    said = replace(mapped.first, comment="after the guideways of both axes were greased")
    text = printed(print_outline(map_outline(mapped.history, STAGE, said, None)))
    assert "comment: after the guideways of both axes were greased\n" in text, "not broken"
    assert "Friction map 1 wafer-xy (simulated)" in text
    rows = [line.split() for line in text.splitlines() if line.strip().startswith(("x ", "y "))]
    assert [row[:2] for row in rows[:2]] == [["x", "25"], ["y", "25"]]
    mean = float(rows[0][2])
    assert mean == pytest.approx(np.mean([level("x", place) for place in GRID]), rel=0.01)
    assert rows[0][3].startswith("-")
    assert rows[0][5].startswith("+")
    assert "C/Fc" not in text, "these calibrations did not show it"


def test_a_place_outside_the_map_says_so(mapped):
    inside, outside = (
        printed(print_sections([at_place(mapped.first, place)]))
        for place in (GRID[3], (0.14, 0.14))
    )
    assert "outside of the map" not in inside
    assert outside.count("outside of the map: the value at its edge") == 2
    shown = float(inside.split("Fc ")[1].split(" N")[0])
    assert shown == pytest.approx(level("x", GRID[3]), rel=0.05)


def test_versions_with_what_was_in_use(mapped):
    used = [Activation(1, BEGIN, "activated"), Activation(None, BEGIN + 9.0, "rolled back")]
    versions = [replace(mapped.first, active=True), mapped.second]
    text = printed(print_sections(versions_sections(STAGE, versions, used)))
    assert "25/25" in text
    assert "rolled back" in text
    assert "none" in text
    assert "no map has been in use yet" in printed(
        print_sections(versions_sections(STAGE, versions, []))
    )


def test_a_changed_site_is_marked(mapped):
    changes = compare(mapped.first.map, mapped.second.map)
    text = printed(print_sections(changes_sections(1, changes).values()))
    marked = [line for line in text.splitlines() if line.rstrip().endswith("changed")]
    x, y = (1e3 * value for value in GRID[7])
    assert any(f"({x:.1f}, {y:.1f})" in line for line in marked)
