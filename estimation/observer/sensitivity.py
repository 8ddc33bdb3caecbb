"""The whole loop of drive and observer: how much it amplifies, and the largest gain that may be.

The sensitivity at a frequency is the following error's part at that frequency, over what the
encoder reads too much. The loop repeats itself from SYNC to SYNC, not from tick to tick; its parts
at other frequencies, folded by the observer's sampling, are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimation.observer.loop import FORCE, INTEGRAL, PeriodMaps
from estimation.observer.model import LACK, ObserverModel
from stagedata import F64

PEAK = 2.0
"""The sensitivity may reach this,"""
PEAK_OVER_DRIVE = 1.1
"""or so many times its peak with the drive alone, if that is more."""
LATENCIES = (1, 2)
"""SYNC periods from a sample to the offset that it changes, for which that holds."""
GAINS = tuple(np.geomspace(0.01, 1.0, 65).tolist())
LOWEST = 2.0
"""Frequencies are looked at from here [Hz]."""
_FREQUENCIES = 60
_STABLE = 1.0 - 1e-9


class Loop(NamedTuple):
    """A loop from SYNC to SYNC: noise in each of n ticks to following error in each tick."""

    a: F64
    b: F64
    c: F64
    d: F64


def drive_alone(maps: PeriodMaps) -> Loop:
    """The loop of the drive without an observer."""
    return Loop(maps.transition, maps.noise, maps.error, maps.error_noise)


def with_observer(maps: PeriodMaps, model: ObserverModel, gain: float, latency: int = 1) -> Loop:
    """The loop with an observer.

    Its state: the axis, the observer's prediction, the offsets of this period and of those before.
    Integrator and correction can be exchanged without any effect, so the correction is counted
    with the integrator.

    Args:
        maps: of the axis as it is.
        model: of the observer.
        gain: g of the correction.
        latency: periods from a sample to its offset; of the second the observer knows nothing.
    """
    axis, own = len(maps.transition), len(model.transition)
    size = axis + own + latency + 1
    seen, now = slice(axis, axis + own), axis + own  # offsets: now, one period ago, ...
    a, b = np.zeros((size, size)), np.zeros((size, maps.noise.shape[1]))
    a[:axis, :axis], b[:axis] = maps.transition, maps.noise
    a[:axis, now + latency - 1] += maps.ramp_to
    a[:axis, now + latency] += maps.ramp_from
    corrected = model.transition @ model.gain
    a[seen, seen] = model.transition
    a[seen, axis] -= corrected
    a[seen, 0] += corrected
    b[seen, 0] += corrected
    a[seen, now] += model.ramp_to
    a[seen, now + 1] += model.ramp_from
    a[now] = gain / model.force_ratio * a[axis + LACK]
    b[now] = gain / model.force_ratio * b[axis + LACK]
    a[now, now] += 1.0 - gain
    for k in range(latency):
        a[now + 1 + k, now + k] = 1.0
    c = np.zeros((len(maps.error), size))
    c[:, :axis] = maps.error
    c[:, now + latency - 1] += maps.error_to
    c[:, now + latency] += maps.error_from
    exchange = np.zeros(size)
    exchange[INTEGRAL], exchange[now:] = 1.0, -1.0
    exchange[axis + FORCE], exchange[axis + LACK] = -1.0, -model.force_ratio
    exchange[axis + LACK + 1 : now] = -1.0
    keep = [k for k in range(size) if k != now]
    counted = np.eye(size)
    counted[:, now] += exchange
    counted, back = counted[keep], np.eye(size)[:, keep]
    return Loop(counted @ a @ back, counted @ b, c @ back, maps.error_noise)


def peak_sensitivity(loop: Loop, period: float) -> float:
    """Peak of the sensitivity up to half the SYNC frequency; infinite where it is unstable."""
    if np.abs(np.linalg.eigvals(loop.a)).max() > _STABLE:
        return float("inf")
    frequency = np.geomspace(LOWEST, 0.5 / period, _FREQUENCIES)
    z = np.exp(2j * np.pi * frequency * period)
    ticks = len(loop.d)
    wave = np.exp(2j * np.pi * frequency[:, None] * (period / ticks) * np.arange(ticks))
    inside = z[:, None, None] * np.eye(len(loop.a)) - loop.a
    state = np.linalg.solve(inside, (wave @ loop.b.T)[:, :, None])[:, :, 0]
    error = state @ loop.c.T + wave @ loop.d.T
    return float(np.abs((wave.conj() * error).sum(axis=1) / ticks).max())
