"""Noise of position and force samples."""

from __future__ import annotations

import math


def quantisation(step: float) -> float:
    """Rms of rounding to multiples of `step`, in its unit."""
    return step / math.sqrt(12.0)


def encoder_noise(noise: float, increment: float) -> float:
    """Rms of a sampled position: encoder noise and its increment, both [m]."""
    return math.hypot(noise, quantisation(increment))
