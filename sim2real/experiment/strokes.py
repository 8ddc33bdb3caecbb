"""A jerk-limited stroke in closed form: a trapezoidal velocity, smoothed to limit the jerk."""

from __future__ import annotations

import numpy as np

from stagedata import F64


def stroke(distance: float, speed: float, acceleration: float, jerk: float, period: float) -> F64:
    """Positions of a move from 0 to rest at `distance`, one per period, float64[n] [m].

    Args:
        distance: signed [m].
        speed: largest [m/s].
        acceleration: largest [m/s^2].
        jerk: largest [m/s^3].
        period: [s].
    """
    far = abs(distance)
    peak = min(speed, np.sqrt(far * acceleration))
    if peak <= 0.0:
        return np.zeros(1)
    ramp = peak / acceleration
    total = far / peak + ramp
    window = max(1, round(acceleration / jerk / period))
    t = period * np.arange(1, int(np.ceil(total / period)) + 1)
    up = 0.5 * acceleration * np.minimum(t, ramp) ** 2
    even = peak * np.clip(t - ramp, 0.0, total - 2.0 * ramp)
    left = np.clip(t - (total - ramp), 0.0, ramp)
    raw = up + even + peak * left - 0.5 * acceleration * left**2
    padded = np.concatenate((np.zeros(window), raw, np.full(window - 1, far)))
    sums = np.cumsum(padded)
    smooth: F64 = (sums[window:] - sums[:-window]) / window
    return np.asarray(np.sign(distance) * smooth)
