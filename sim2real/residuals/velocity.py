"""The mean residual force over velocity, with its sign and its spread, for each direction.

What acts against the motion shows as a step between the directions, what grows with speed as a
slope, and what differs between the directions as two different slopes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.residuals.bins import Bins
from sim2real.residuals.course import Course
from stagedata import FloatArray

_BINS = 24
"""Bins of each direction; their width grows with speed, as friction changes most at low speeds."""
_FEWEST = 8
"""Samples of a bin that counts."""


@dataclass(frozen=True, slots=True, eq=False)
class VelocityMeans:
    """Mean residual force over velocity in one direction, n bins.

    Attributes:
        direction: +1 or -1.
        velocity: mean of each bin, signed, ascending in size, float64[n] [m/s].
        samples: of each bin, float64[n].
        bins: number of each bin, int64[n]; where numbers are missing, these speeds did not occur.
        mean, spread: model -> mean of measured minus simulated force, and its standard deviation
            in the bin, float64[n] [N].
    """

    direction: int
    velocity: FloatArray
    samples: FloatArray
    bins: NDArray[np.int64]
    mean: Mapping[str, FloatArray]
    spread: Mapping[str, FloatArray]


def average_over_velocity(course: Course) -> tuple[VelocityMeans, ...]:
    """Mean residual force over velocity, backward and forward; a direction without motion has none.

    Args:
        course: of the axis; samples at rest and invalid ones do not count.
    """
    counted = course.moving & course.valid
    speed = np.abs(course.velocity)
    fastest = float(speed[counted].max()) if counted.any() else 0.0
    if fastest == 0.0:
        return ()
    edges = fastest * np.linspace(0.0, 1.0, _BINS + 1) ** 2
    out = []
    for direction in (-1, 1):
        inside = counted & (direction * course.velocity > 0.0)
        bins = Bins(speed[inside], edges, _FEWEST)
        if not len(bins.samples):
            continue
        residuals = {model: course.residual(model)[inside] for model in course.simulated}
        out.append(
            VelocityMeans(
                direction,
                bins.mean(course.velocity[inside]),
                bins.samples,
                bins.numbers,
                {model: bins.mean(values) for model, values in residuals.items()},
                {model: bins.spread(values) for model, values in residuals.items()},
            )
        )
    return tuple(out)
