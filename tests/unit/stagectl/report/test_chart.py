"""Charts as data beside their place in a page."""

import json
import re

import numpy as np
from markupsafe import escape

from stagectl.report.chart import Chart, Curve, legend


def data(chart):
    found = re.search(r'application/json">(.*)</script>', str(escape(chart)))
    assert found is not None
    return dict(json.loads(found[1]))


def test_a_chart_has_its_curves_with_what_can_be_drawn():
    gone = np.array([np.nan, -1.0, 0.0, 1.0, 10.0])
    chart = Chart([Curve("after", gone, gone)], "x", "y <z>", log="xy")
    (curve,) = data(chart)["curves"]
    assert curve == {"name": "after", "line": True, "x": [1.0, 10.0], "y": [1.0, 10.0]}
    assert "y &lt;z&gt; over x" in escape(chart)


def test_long_curves_are_thinned_but_those_with_a_band_keep_it():
    x = np.arange(1e5)
    (curve,) = data(Chart([Curve("measured", x, np.sin(x))], "x", "y"))["curves"]
    assert len(curve["x"]) == len(curve["y"]) < 1000
    few = np.arange(3.0)
    (curve,) = data(Chart([Curve("measured", few, few, few - 1, few + 1)], "x", "y"))["curves"]
    assert (curve["low"], curve["high"]) == ([-1.0, 0.0, 1.0], [1.0, 2.0, 3.0])


def test_times_keep_their_seconds():
    at = np.array([1.7e9, 1.7e9 + 1.0])
    (curve,) = data(Chart([Curve("after", at, at, has_line=False)], "", "N", is_time=True))[
        "curves"
    ]
    assert curve["x"] == [1.7e9, 1.7e9 + 1.0]


def test_without_anything_to_draw_it_says_so():
    nothing = np.array([np.nan])
    assert "Nothing to draw" in escape(Chart([], "x", "y"))
    assert "Nothing to draw" in escape(Chart([Curve("after", nothing, nothing)], "x", "y"))


def test_a_legend_escapes_its_words():
    assert '<i class="before"></i>a &lt;b&gt;' in legend("measured", ("before", "a <b>"))
