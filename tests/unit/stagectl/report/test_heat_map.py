"""A figure over a plane as a picture: to proportion, signs have colours, nothing has none."""

import re
from dataclasses import replace

import numpy as np
import pytest

from stagectl.report.heat_map import HeatMap, draw_heat_map, round_limit

EDGES = np.array([-10.0, 0.0, 10.0])
LABELS = ("x, mm", "y, mm", "N")
PLANE = HeatMap(
    EDGES, EDGES, np.full((2, 2), np.nan), (-2.0, 2.0), LABELS, "a <b>", two_inks=True
)  # fmt: skip


def inks(svg):
    """(class, opacity) of the cells, in order; the scale's are rectangles."""
    return re.findall(r'<path[^>]*class="(above|below)" fill-opacity="([\d.]+)"', svg)


@pytest.mark.parametrize(("long", "wide"), [(0.1, 0.1), (0.3, 0.1), (0.1, 0.2)])
def test_the_table_is_drawn_as_long_as_wide_as_it_is(long, wide):
    x, y = np.linspace(0.0, long, 20), np.linspace(0.0, wide, 20)
    values = np.outer(x[1:], y[1:])
    corners = [(0.0, 0.0), (long, wide)]
    drawn = draw_heat_map(HeatMap(x, y, values, (0.0, float(values.max())), LABELS, "f", corners))
    places = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', drawn)
    (x0, y0), (x1, y1) = ((float(a), float(b)) for a, b in places)
    assert (x1 - x0) / (y0 - y1) == pytest.approx(long / wide, rel=0.02)
    assert max(x1 - x0, y0 - y1) == pytest.approx(240.0)


def test_colours_tell_sign_and_size():
    values = np.array([[-2.0, -1.0], [1.0, 5.0]])
    svg = draw_heat_map(replace(PLANE, values=values))
    (a, most), (b, less), (c, some), (d, all_) = inks(svg)
    assert (a, b, c, d) == ("below", "below", "above", "above")
    assert float(most) == float(all_) > 0.9
    assert (float(less), float(some)) == pytest.approx((0.5, 0.5), abs=0.06)
    assert "a &lt;b&gt;" in svg
    assert ">2.00<" in svg


def test_zero_is_all_but_paper_and_what_is_unknown_is_neither():
    svg = draw_heat_map(replace(PLANE, values=np.array([[0.0, np.nan], [np.nan, np.nan]])))
    ((_, opacity),) = inks(svg)
    assert float(opacity) < 0.05
    (cell,) = re.findall(r'<path[^>]*class="paper" d="([^"]+)"', svg)
    assert cell.count("z") == 1


def test_the_scale_is_the_same_on_both_sides_of_zero():
    svg = draw_heat_map(PLANE)
    above, below = (re.findall(f'<rect[^>]*class="{kind}"', svg) for kind in ("above", "below"))
    assert len(above) == len(below) > 5


@pytest.mark.parametrize(
    ("values", "limit"), [([0.0, np.nan], 1.0), ([np.nan], 1.0), ([-0.18], 0.2), ([4.0, 4.1], 5.0)]
)
def test_the_limit_is_round_and_not_below_the_values(values, limit):
    assert round_limit(np.array(values)) == pytest.approx(limit)
