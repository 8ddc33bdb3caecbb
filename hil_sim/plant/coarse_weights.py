"""How the motor's force acts within one coarse step, as weights; see `hil_sim.plant.coarse`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def motor_weights(decay: float, share: F64) -> F64:
    """How the motor force acts in one coarse step, as weights of what it depends on.

    Args:
        decay: 2 pi bandwidth times the fine step.
        share: weight of the output before its step in each fine step, float64[n].

    Returns:
        float64[3, 2]: rows for the force at the end, its mean for the velocity and its mean for
        the displacement; columns for the earlier output and the force at the start. What is
        missing to 1 (displacement: to (n + 1)/(2n)) is the weight of the present output.
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
