"""One axis of a map over the table: what is drawn and summed up of it."""

import numpy as np
import pytest

from stagectl.maps import compare
from stagectl.maps.output import changes_sections, map_outline, version_as_json
from stagectl.maps.output.page import render_map
from stagectl.maps.output.surface import surface
from stagectl.report import print_outline, print_sections
from tests.unit.stagectl.maps.conftest import STAGE
from tests.unit.stagectl.printed import printed


def test_terminal_page_and_json_say_the_same(mapped):
    first, second = mapped.first, mapped.second
    page = render_map(mapped.history, STAGE, second, first)
    text = printed(print_outline(map_outline(mapped.history, STAGE, second, first)))
    told = version_as_json(second)["axes"]
    for name, axis in second.map.axes.items():
        known = surface(axis).known_to
        assert f"{100 * known:.1f} %" in text
        assert f"known to {100 * known:.1f} %" in page
        assert told[name]["known_to"] == pytest.approx(known)
        # Between the sites less is known than at them.
        assert known > np.median([site.sigma for site in axis.sites])
    changes = changes_sections(1, compare(first.map, second.map)).values()
    for listed in (page, printed(print_sections(changes))):
        assert listed.count("and 15 more, changed less") == 2  # of 25 sites, 10 are listed
