"""One axis of a map over the table: what is drawn and summed up of it."""

import numpy as np
import pytest

from stagectl.maps import changes_sections, compare, map_outline, version_as_json
from stagectl.maps.output.page import render_map
from stagectl.maps.output.surface import surface
from stagectl.report import print_outline, print_sections
from tests.unit.stagectl.maps.conftest import STAGE, printed


def test_known_to_is_one_figure_on_terminal_page_and_json(history, warmer):
    first, second = warmer
    page = render_map(history, STAGE, second, first)
    text = printed(print_outline(map_outline(history, STAGE, second, first)))
    told = version_as_json(second)["axes"]
    for name, axis in second.map.axes.items():
        known = surface(axis).known_to
        assert f"{100 * known:.1f} %" in text
        assert f"known to {100 * known:.1f} %" in page
        assert told[name]["known_to"] == pytest.approx(known)
        # Between the sites less is known than at them.
        assert known > np.median([site.sigma for site in axis.sites])


def test_lists_that_are_cut_say_how_many_more(history, warmer):
    first, second = warmer
    page = render_map(history, STAGE, second, first)
    text = printed(print_sections(changes_sections(1, compare(first.map, second.map)).values()))
    for told in (page, text):
        assert told.count("and 15 more, changed less") == 2  # of 25 sites, 10 are listed
