"""Convex hull of sites, and the nearest point of it."""

import math

import numpy as np
import pytest

from estimation.field.convex_hull import Hull


def test_hull_and_the_nearest_point_of_it():
    square = Hull.of(np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 1], [1, 0]], float))
    assert len(square.corners) == 4
    wanted = np.array([[1, 1], [3, 1], [3, 3], [1, -0.5]], float)
    points, away = square.clamp(wanted)
    assert points.tolist() == [[1, 1], [2, 1], [2, 2], [1, 0]]
    assert away == pytest.approx([0, 1, math.sqrt(2), 0.5])
    points, away = square.clamp(wanted, 0.6)
    assert points[1].tolist() == pytest.approx([2.6, 1])
    assert away == pytest.approx([0, 0.4, math.sqrt(2) - 0.6, 0])
    for flat in ([[1, 1]], [[0, 0], [2, 2]], [[0, 0], [1, 1], [2, 2], [0.5, 0.5]]):
        points, away = Hull.of(np.array(flat, float)).clamp(np.array([[1.0, 1.0]]))
        assert (points.tolist(), away.tolist()) == ([[1.0, 1.0]], [0.0])
