"""The residual over position and velocity."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.residuals.plane import average_over_plane


def test_cells_hold_the_mean_of_what_passed_through_them(with_residual):
    plane = average_over_plane(with_residual(lambda x, v: 100.0 * x + np.sign(v)))
    values = plane.mean["before"]
    x = (plane.positions[1:] + plane.positions[:-1]) / 2
    v = (plane.velocities[1:] + plane.velocities[:-1]) / 2
    assert values.shape == (len(x), len(v))
    visited = np.isfinite(values)
    # The sine is an ellipse: each speed at two positions, and its middle is empty.
    assert 0.05 < visited.mean() < 0.3
    assert not visited[len(x) // 2, len(v) // 2]
    expected = 100.0 * x[:, None] + np.sign(v)[None, :]
    assert values[visited] == pytest.approx(expected[visited], abs=0.06)


def test_no_cell_holds_both_directions(with_residual):
    plane = average_over_plane(with_residual(lambda x, v: np.sign(v)))
    values = plane.mean["before"]
    assert set(np.unique(values[np.isfinite(values)])) == {-1.0, 1.0}


def test_without_motion_there_is_no_plane(course):
    assert average_over_plane(replace(course, moving=np.zeros(len(course.moving), bool))) is None
