"""The plots' text."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stagectl.report.svg import Line, Panel, Span, draw, thinned, ticks

SVG = "{http://www.w3.org/2000/svg}"


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_round_and_inside(low, width):
    found = ticks(low, low + width)
    slack = 1e-6 * width + 1e-9 * abs(low)
    assert 1 <= len(found) <= 8
    assert all(low - slack <= t <= low + width + slack for t in found)


def test_a_line_spans_its_panel():
    x = np.linspace(0.0, 10.0, 1000)
    root = ET.fromstring(draw([[Panel("t", "y", (Line(x, x),))]], 500, 200, "a & b"))  # noqa: S314
    points = [
        tuple(map(float, p.split(","))) for p in root.find(f"{SVG}polyline").get("points").split()
    ]
    assert len(points) <= 802
    assert (points[0][0], points[-1][0]) == (62, 488)
    assert points[0][1] > points[-1][1]
    assert root.find(f"{SVG}title").text == "a & b"


def test_a_spike_stays_in_a_thinned_curve():
    x, y = np.arange(100_000.0), np.zeros(100_000)
    y[12_345], y[67_890] = 5.0, -3.0
    fewer_x, fewer_y = thinned(x, y, 100)
    assert len(fewer_x) < 110
    assert (fewer_x[0], fewer_x[-1]) == (0.0, 99_999.0)
    assert dict(zip(fewer_x.tolist(), fewer_y.tolist(), strict=True))[12_345.0] == 5.0
    assert fewer_y.min() == -3.0


def test_spans_are_cut_at_the_axes():
    x = np.linspace(0.0, 1.0, 5)
    panel = Panel("t", "y", (Line(x, 0 * x),), (Span(0.5, 9.0, "late", "#eeeeee"),))
    root = ET.fromstring(draw([[panel]], 500, 200, "t"))  # noqa: S314
    span = next(r for r in root.findall(f"{SVG}rect") if r.get("fill") == "#eeeeee")
    assert float(span.get("x")) + float(span.get("width")) == pytest.approx(488)
