"""Velocity and acceleration from sampled positions, and the noise that they carry.

Central differences: no lag, exact for constant jerk but for a term of Ts^2/6 jerk in the velocity,
and no filter that would bias the estimate (the noise is accounted for instead).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Motion at the samples that have a neighbour on both sides; all float64, shape (K - 2,).

    Attributes:
        position [m], velocity [m/s], acceleration [m/s^2].
    """

    position: F64
    velocity: F64
    acceleration: F64


def differentiate(position: F64, period: float) -> Kinematics:
    """Central first and second differences of `position` [m], shape (K,), K >= 3.

    Raises:
        ValueError: fewer than three samples.
    """
    if len(position) < 3:
        raise ValueError(f"at least 3 samples are needed, got {len(position)}")
    velocity = (position[2:] - position[:-2]) / (2.0 * period)
    acceleration = (position[2:] - 2.0 * position[1:-1] + position[:-2]) / period**2
    return Kinematics(position[1:-1], velocity, acceleration)


def force_noise(
    mass: float, encoder_noise: float, increment: float, force_unit: float, period: float
) -> float:
    """Rms of measured force minus mass times acceleration, from the sensors alone [N].

    Args:
        mass: of the axis [kg].
        encoder_noise: rms [m].
        increment: of the encoder [m].
        force_unit: step of the force actual value [N].
        period: of the samples [s].
    """
    position = float(np.hypot(encoder_noise, increment / np.sqrt(12.0)))
    return float(np.hypot(np.sqrt(6.0) * mass * position / period**2, force_unit / np.sqrt(12.0)))
