"""Which SYNC period each sample of a recording belongs to.

Host time stamps jitter, and a busy host skips whole periods; the drives then hold their
setpoint.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stagedata import FloatArray

_LEVEL = 15
"""Samples before and after a jump in time whose medians tell whether the jump lasts."""
_DRIFT = 0.01
"""A clock off by more than this share is counted in periods of its own."""
_MAX_STRETCH = 10
"""Most SYNC periods per sample: beyond that the samples are not one run."""


def match_periods(time: FloatArray, period: float) -> NDArray[np.int64]:
    """Number of the SYNC period of each sample, from 0, strictly increasing, int64[K].

    Args:
        time: of the samples, float64[K] [s].
        period: of the model's SYNC [s].

    Raises:
        ValueError: the samples are not one SYNC period apart.
    """
    if len(time) < 2:
        return np.arange(len(time))
    usual = float(np.median(np.diff(time)))
    if abs(usual - period) > 0.1 * period:
        raise ValueError(
            f"its samples are {usual:.6g} s apart, the model's sync_period is {period:g} s"
        )
    places = number_periods(time, usual if abs(usual - period) > _DRIFT * period else period)
    _check_stretch(places[-1], len(time), period)
    return places


def skipped_periods(before: float, time: FloatArray, period: float) -> int:
    """Number of SYNC periods skipped between two blocks of a recording.

    Args:
        before: time of the last sample of the first block [s].
        time: of the samples of the second, float64[K] [s].
        period: of the model's SYNC [s].

    Raises:
        ValueError: the blocks are not one run.
    """
    skipped = max(round((float(time[0]) - before) / period) - 1, 0)
    _check_stretch(skipped, len(time), period)
    return skipped


def _check_stretch(periods: int, samples: int, period: float) -> None:
    if periods > _MAX_STRETCH * samples:
        raise ValueError(f"its samples are spread over {periods * period:.6g} s")


def number_periods(time: FloatArray, period: float) -> NDArray[np.int64]:
    """Number of the SYNC period of each sample, from 0, strictly increasing, int64[K].

    Samples are numbered consecutively except where time jumps ahead for good: periods were skipped
    there. A few late time stamps are no jump.

    Args:
        time: of the samples, float64[K] [s].
        period: of the SYNC [s].
    """
    steps = np.arange(len(time))
    place = steps.copy()
    level = (time - time[0]) / period - steps
    jumps = np.flatnonzero(np.diff(level) > 0.5)
    edges = [-1, *jumps.tolist(), len(time) - 1]
    for number, jump in enumerate(jumps, start=1):
        before = level[max(edges[number - 1] + 1, jump + 1 - _LEVEL) : jump + 1]
        after = level[jump + 1 : min(edges[number + 1] + 1, jump + 1 + _LEVEL)]
        place[jump + 1 :] += max(round(float(np.median(after) - np.median(before))), 0)
    return place
