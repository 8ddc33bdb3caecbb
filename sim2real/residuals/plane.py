"""The mean residual force over position and velocity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sim2real.residuals.bins import bin_of
from sim2real.residuals.course import Course
from stagedata import FloatArray

_POSITIONS, _VELOCITIES = 48, 24
"""Cells; an even number over velocity, so that none holds both directions."""
_FEWEST = 2
"""Samples of a cell that counts."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualPlane:
    """Mean residual force in cells of position and velocity.

    Attributes:
        positions, velocities: edges of the cells, float64[n + 1], float64[m + 1] [m, m/s].
        mean: model -> mean of measured minus simulated force, float64[n, m] [N]; nan in cells
            that the axis did not pass through.
    """

    positions: FloatArray
    velocities: FloatArray
    mean: Mapping[str, FloatArray]


def average_over_plane(course: Course) -> ResidualPlane | None:
    """Mean residual force over position and velocity; None where the axis does not move.

    Args:
        course: of the axis; samples at rest and invalid ones do not count.
    """
    counted = course.moving & course.valid & (course.velocity != 0.0)
    if not counted.any():
        return None
    position, velocity = course.position[counted], course.velocity[counted]
    fastest = float(np.abs(velocity).max())
    if np.ptp(position) == 0.0:
        return None
    positions = np.linspace(float(position.min()), float(position.max()), _POSITIONS + 1)
    velocities = np.linspace(-fastest, fastest, _VELOCITIES + 1)

    at = bin_of(position, positions) * _VELOCITIES + bin_of(velocity, velocities)
    size = _POSITIONS * _VELOCITIES
    number = np.bincount(at, minlength=size)
    mean = {}
    for model in course.simulated:
        sums = np.bincount(at, weights=course.residual(model)[counted], minlength=size)
        values = np.where(number >= _FEWEST, sums / np.maximum(number, 1), np.nan)
        mean[model] = values.reshape(_POSITIONS, _VELOCITIES)
    return ResidualPlane(positions, velocities, mean)
