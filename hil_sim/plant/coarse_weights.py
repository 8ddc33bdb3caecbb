"""Weights of the motor force within one coarse step; see `hil_sim.plant.coarse`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def motor_weights(decay: float, share: F64) -> F64:
    """Weights by which outputs and initial force make up the motor force in one coarse step.

    Args:
        decay: 2 pi bandwidth times the fine step.
        share: weight of the earlier output in each fine step, float64[n].

    Returns:
        float64[3, 2]: rows for the force at the end, its mean in the velocity and its mean in the
        displacement; columns for the earlier output and the force at the start. The present output
        has the remaining weight, to 1 or, for the displacement, to (n + 1)/(2n).
    """
    count = len(share)
    gain = 1.0 - math.exp(-decay)
    end = np.array([0.0, 1.0])
    velocity, displacement = np.zeros(2), np.zeros(2)
    for i, before in enumerate(share):
        end = end + gain * (np.array([before, 0.0]) - end)
        velocity += end / count
        displacement += end * (count - i) / count**2
    return np.array([end, velocity, displacement])
