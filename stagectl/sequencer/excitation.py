"""Setpoints that shake an axis: a chirp or a multisine within limits of velocity to jerk."""

from __future__ import annotations

import math

import numpy as np

from stagectl.recipe import Excite
from stagedata import F64

_TAPER = 0.1
"""Share of the duration over which the amplitude rises, and falls again."""
_LINES_PER_OCTAVE = 6
_CONTINUOUS = 0.8
"""Share of the limits that the smooth signal may use: the taper adds to its derivatives."""


def excitation_setpoints(wanted: Excite, period: float) -> F64:
    """Displacements from the start, at rest at both ends, float64[K] [m].

    A chirp's frequency grows by the same factor in equal times; its amplitude is smaller where the
    profile's velocity, acceleration or jerk would be exceeded. A multisine has logarithmically
    spaced lines with Schroeder's phases (IEEE Trans. Inf. Theory 16, 1970), each as large as a
    chirp there, and is scaled down as a whole where their sum exceeds a limit.

    Args:
        wanted: the excitation.
        period: Ts [s].
    """
    count = max(2, round(wanted.duration / period))
    time = np.asarray(np.arange(1, count + 1) * period, dtype=np.float64)
    low, high = wanted.band
    shape = _chirp if wanted.shape == "chirp" else _multisine
    raw = shape(wanted, time, low, high) * _window(count)
    raw[-1] = 0.0
    return raw * _scale(wanted, raw, period)


def _chirp(wanted: Excite, time: F64, low: float, high: float) -> F64:
    rate = math.log(high / low) / wanted.duration
    frequency = low * np.exp(rate * time)
    phase = 2.0 * math.pi * (frequency - low) / rate
    return np.asarray(_amplitude(wanted, frequency) * np.sin(phase))


def _multisine(wanted: Excite, time: F64, low: float, high: float) -> F64:
    count = max(2, round(_LINES_PER_OCTAVE * math.log2(high / low)) + 1)
    # Whole periods within the duration: the lines do not leak into one another.
    lines = np.unique(np.rint(np.geomspace(low, high, count) * wanted.duration)) / wanted.duration
    size = _amplitude(wanted, lines)
    power = np.cumsum(np.concatenate(([0.0], size[:-1] ** 2))) / np.sum(size**2)
    phases = -2.0 * math.pi * np.cumsum(np.concatenate(([0.0], power[1:]))) * len(lines) / 2.0
    angles = 2.0 * math.pi * lines[:, None] * time + phases[:, None]
    return np.asarray((size[:, None] * np.sin(angles)).sum(axis=0))


def _amplitude(wanted: Excite, frequency: F64) -> F64:
    """Largest amplitude of a sine at each frequency [m]."""
    profile, omega = wanted.profile, 2.0 * math.pi * frequency
    limits = (profile.velocity / omega, profile.acceleration / omega**2, profile.jerk / omega**3)
    return np.asarray(np.minimum(wanted.amplitude, _CONTINUOUS * np.minimum.reduce(limits)))


def _window(count: int) -> F64:
    """Cosine tapers at both ends, float64[count]."""
    rise = max(1, round(_TAPER * count))
    taper = 0.5 * (1.0 - np.cos(math.pi * np.arange(1, rise + 1) / rise))
    window = np.ones(count)
    window[:rise] *= taper
    window[count - rise :] *= taper[::-1]
    return window


def _scale(wanted: Excite, displacement: F64, period: float) -> float:
    """Factor that brings displacement and its derivatives within their limits."""
    profile = wanted.profile
    values = np.concatenate((np.zeros(3), displacement, np.zeros(3)))
    limits = (wanted.amplitude, profile.velocity, profile.acceleration, profile.jerk)
    factor = 1.0
    for order, limit in enumerate(limits):
        largest = float(np.abs(np.diff(values, order)).max()) / period**order
        factor = min(factor, limit / largest if largest > 0.0 else 1.0)
    return factor
