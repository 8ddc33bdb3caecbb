"""Pictures and lists of a map's page."""

import re

import numpy as np
import pytest

from stagectl.history import Trend
from stagectl.maps.output import draw_maps
from stagectl.maps.output.page import MOST, trend_chart
from stagectl.maps.output.surface import surface
from tests.unit.stagectl.maps.conftest import BEGIN


def scale(picture):
    """Lowest and highest number beside the colour scale."""
    numbers = re.findall(r'text-anchor="start">([\d.]+)</text>', picture)
    return float(numbers[0]), float(numbers[2])


def test_maps_that_are_compared_have_one_scale(mapped):
    first, second = mapped.first, mapped.second
    drawn = draw_maps(second, first)
    for name, axis in second.map.axes.items():
        now, before, _ = drawn[name]
        assert scale(now) == scale(before)
        values = [surface(a).value for a in (axis, first.map.axes[name])]
        low, high = scale(now)
        assert low == pytest.approx(min(map(np.nanmin, values)), abs=0.006)
        assert high == pytest.approx(max(map(np.nanmax, values)), abs=0.006)
    x, y = (scale(drawn[name][-1]) for name in ("x", "y"))
    assert x == y
    alone = draw_maps(second, None)
    assert all(len(pictures) == 2 for pictures in alone.values())


def trend(values, sigma=0.05):
    count = len(values)
    nothing = np.full(count, np.nan)
    return Trend(
        BEGIN + 60.0 * np.arange(count), {"coulomb": np.asarray(values, float)},
        {"coulomb": np.broadcast_to(np.asarray(sigma, float), count)}, np.ones(count), nothing,
        ("macro",) * count, (1,) * count,
    )  # fmt: skip


def test_of_a_trend_the_last_points_are_drawn():
    values = np.linspace(5.0, 6.0, MOST + 50)
    _, points = trend_chart(trend(values), 6.0).curves
    assert points.y.tolist() == values[50:].tolist()
    assert not points.has_line


def test_a_vague_first_estimate_does_not_flatten_the_others():
    sigma = np.array([5.0] + [0.02] * 40)
    low, high = trend_chart(trend([6.0] + [6.0, 6.2] * 20, sigma), 6.0).y_range
    assert high - low < 0.4


def test_the_maps_value_is_always_in_the_picture():
    chart = trend_chart(trend([6.0, 6.1]), 9.0)
    assert chart.y_range[1] > 9.0
    assert chart.curves[0].y.tolist() == [9.0, 9.0]


@pytest.mark.parametrize("values", [[6.0], [6.0, np.nan, 6.1], [6.0, 6.0]])
def test_one_point_gaps_and_a_constant_can_be_drawn(values):
    chart = trend_chart(trend(values, sigma=0.0), 6.0)
    assert len(chart.curves[1].x) == np.isfinite(values).sum()
    assert chart.y_range[0] < chart.y_range[1]


def test_a_figure_that_no_estimate_has_makes_no_picture():
    assert trend_chart(trend([np.nan, np.nan]), 6.0) is None
