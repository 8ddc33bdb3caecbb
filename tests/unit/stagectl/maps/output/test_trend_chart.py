"""A trend as SVG: scaled to what matters, the last points only, and the map's value."""

from __future__ import annotations

import re
from xml.dom.minidom import parseString

import numpy as np
import pytest

from stagectl.history import Trend
from stagectl.maps.output.trend_chart import MOST, draw_trend

BEGIN = 1.7e9


def trend(values, sigma=0.05, step=60.0):
    count = len(values)
    nothing = np.full(count, np.nan)
    return Trend(
        BEGIN + step * np.arange(count), {"coulomb": np.asarray(values, float)},
        {"coulomb": np.broadcast_to(np.asarray(sigma, float), count)}, np.ones(count), nothing,
        ("macro",) * count, (1,) * count,
    )  # fmt: skip


def heights(svg):
    """Of the points, from the bottom up [px]."""
    return [150.0 - float(y) for y in re.findall(r'<circle cx="[\d.]+" cy="([\d.]+)"', svg)]


def test_points_rise_with_the_value_and_the_picture_is_xml():
    svg = draw_trend(trend([6.0, 6.2, 6.1, 6.4]), "coulomb", "x", None)
    parseString(svg)  # noqa: S318  our own
    first, second, third, last = heights(svg)
    assert first < third < second < last


def test_only_the_last_points_are_drawn():
    svg = draw_trend(trend(np.linspace(5.0, 6.0, MOST + 50)), "coulomb", "x", None)
    assert len(heights(svg)) == MOST


def test_a_vague_first_estimate_does_not_flatten_the_others():
    sigma = np.array([5.0] + [0.02] * 40)
    found = heights(draw_trend(trend([6.0] + [6.0, 6.2] * 20, sigma), "coulomb", "x", None))
    assert np.ptp(found[1:]) > 60.0


def test_the_maps_value_is_always_in_the_picture():
    svg = draw_trend(trend([6.0, 6.1]), "coulomb", "x", at_map=9.0)
    (height,) = re.findall(r'y1="([\d.]+)" y2="[\d.]+" stroke="#c0392b"', svg)
    assert 22.0 <= float(height) <= 128.0
    assert "#c0392b" not in draw_trend(trend([6.0, 6.1]), "coulomb", "x", None)


@pytest.mark.parametrize("values", [[6.0], [6.0, np.nan, 6.1], [6.0, 6.0]])
def test_one_point_gaps_and_a_constant_can_be_drawn(values):
    svg = draw_trend(trend(values, sigma=0.0), "coulomb", "x", None)
    parseString(svg)  # noqa: S318  our own
    assert len(heights(svg)) == np.isfinite(values).sum()
    assert "nan" not in svg


def test_a_figure_that_no_estimate_has_makes_no_picture():
    assert draw_trend(trend([np.nan, np.nan]), "coulomb", "x", 6.0) == ""


def test_seconds_are_shown_where_all_lies_within_minutes():
    assert "22:13:20" in draw_trend(trend([6.0, 6.1], step=1.0), "coulomb", "x", None)
    assert "22:13:20" not in draw_trend(trend([6.0, 6.1], step=6000.0), "coulomb", "x", None)
