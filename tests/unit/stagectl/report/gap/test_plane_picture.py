"""The picture over position and velocity: signs have colours, nothing has none."""

import re

import numpy as np
import pytest

from stagectl.report.gap.plane_picture import STEPS, colour_limit, plane_picture

EDGES = np.array([-10.0, 0.0, 10.0])


def inks(svg):
    """(class, opacity) of the cells, in order; the scale's are rectangles."""
    return re.findall(r'<path class="(above|below)" fill-opacity="([\d.]+)"', svg)


def test_colours_tell_sign_and_size():
    values = np.array([[-2.0, -1.0], [1.0, 5.0]])
    svg = plane_picture(EDGES, EDGES, values, 2.0, "a <b>")
    assert inks(svg) == [("below", "1.00"), ("below", "0.50"), ("above", "0.50"), ("above", "1.00")]
    assert "a &lt;b&gt;" in svg
    assert "+2 N" in svg


def test_zero_is_paper_and_what_is_unknown_is_neither():
    svg = plane_picture(EDGES, EDGES, np.array([[0.0, np.nan], [np.nan, np.nan]]), 2.0, "t")
    assert inks(svg) == []
    (cell,) = re.findall(r'<path class="paper" d="([^"]+)"', svg)
    assert cell.count("z") == 1


def test_the_scale_is_the_same_on_both_sides_of_zero():
    svg = plane_picture(EDGES, EDGES, np.full((2, 2), np.nan), 1.0, "t")
    assert len(re.findall(r'<rect class="above"', svg)) == STEPS
    assert len(re.findall(r'<rect class="below"', svg)) == STEPS


@pytest.mark.parametrize(
    ("values", "limit"), [([0.0, np.nan], 1.0), ([np.nan], 1.0), ([-0.18], 0.2), ([4.0, 4.1], 5.0)]
)
def test_the_limit_is_round_and_not_below_the_values(values, limit):
    assert colour_limit(np.array(values)) == pytest.approx(limit)
