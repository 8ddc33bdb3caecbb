"""From the samples of a move to what is learned from: one clean, evenly spaced record per axis.

Stale and unpunctual samples are marked invalid, skipped SYNC periods become gaps, samples of early
or late SYNCs are interpolated to the grid, and samples whose force says nothing about friction are
masked. The feedforward learns from courses: demand, position and correction of each axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimation.move import MoveData
from estimation.observer import Course
from stagectl.sequencer.samples.sample_validity import (
    EXACT,
    bridged,
    filled_to_grid,
    grid_places,
    is_gapless,
    resampled_to_grid,
    without_stale,
    without_unpunctual,
)
from stagedata import F64, Samples

LATE, LATE_STEPS = 0.03, 100
"""A SYNC off its place by more than this share of Ts makes the drive's demand pause and jump. The
jump matters where the axis would have moved by this many of its smallest steps meanwhile."""
DECAY = 1e-3
"""Time constant of the fast part of the drive's response to such a jump [s]: the low-pass of its
derivative. The rest of the response changes little within a sample period."""
OUTLIER = 8.0
"""Standard deviations by which an outlier disagrees with its neighbours and the force."""

_QUARTER = 0.3186  # first quartile of |normal| over its standard deviation: robust to outliers
_HALF = 0.6745  # its median, likewise
_BEND = np.array([1.0, -2.0, 1.0])
_JUMP = np.convolve(_BEND, _BEND)
_AROUND = len(_JUMP)


def late_setpoints(samples: Samples, period: float) -> NDArray[np.bool_]:
    """Samples disturbed by late setpoints, on the grid of SYNCs, shape (places, n).

    Where setpoints come late, the drive's demand pauses and then jumps. The force changes within
    the following sample period, so the sampled force is not the one that accelerates the axis: with
    setpoints 0.15 ms late at 0.1 m/s it is off by 5 N, on 8 kg.

    Args:
        samples: of a move.
        period: Ts [s].
    """
    if is_gapless(samples, period) and np.ptp(samples.sync) <= LATE * period:
        return np.zeros(samples.position.shape, dtype=np.bool_)
    place = grid_places(samples, period)
    mask = np.zeros((int(place[-1]) + 1, samples.position.shape[1]), dtype=np.bool_)
    away = np.abs(samples.sync - np.median(samples.sync))
    still = np.where(away > LATE * period, away, 0.0)
    passed = np.diff(place, prepend=place[0] - 1) - 1
    still += period * passed
    late = np.flatnonzero(still)
    if not len(late):
        return mask
    for a, position in enumerate(bridged(samples.position, samples).T):
        least = _smallest_jump(samples, a)
        step = np.abs(np.diff(position))
        speed = np.append(step, 0.0) / np.append(np.diff(place), 1)
        for k in late:
            jump = float(speed[max(k - 3, 0) : k + 1].max() * still[k] / period)
            if jump > least:
                mask[
                    max(place[k] - passed[k] - 1, 0) : place[k]
                    + _decayed_after(jump / least, period),
                    a,
                ] = True
    return mask


def missed_syncs(samples: Samples, period: float) -> NDArray[np.bool_]:
    """Samples disturbed by a SYNC that did not reach the drive, after `filled_to_grid`.

    A missing sample may have been lost on its way to the host, which is harmless. Or it was never
    taken and the setpoint never applied: then the drive's demand paused for the length of the gap,
    and the force after it differs from what the force before it predicts.

    Args:
        samples: of a move, shape (K, n).
        period: Ts [s].
    """
    mask = np.zeros(samples.position.shape, dtype=np.bool_)
    if samples.valid.all():
        return mask
    for a, valid in enumerate(samples.valid.T):
        rows = np.flatnonzero(valid)
        apart = np.diff(rows)
        gaps = np.flatnonzero(apart > 1)
        force, position = samples.force[rows, a], samples.position[rows, a]
        if not len(gaps) or len(rows) < _AROUND:
            continue
        least = _smallest_jump(samples, a)
        steps = np.diff(force) / apart
        bends = np.abs(np.diff(steps))[(apart[1:] == 1) & (apart[:-1] == 1)]
        finest = np.abs(steps[steps != 0.0])
        if not len(bends) or not len(finest):
            continue
        usual = max(float(np.median(bends)) / _HALF, float(finest.min()))
        speed = np.abs(np.diff(position)) / apart
        for i in gaps[gaps > 0]:
            before, behind, gap = rows[i], rows[i + 1], apart[i]
            off = abs(force[i + 1] - force[i] - steps[i - 1] * gap)
            jump = float(speed[max(i - 3, 0) : i + 1].max() * (gap - 1))
            known = off <= OUTLIER * usual * gap * (gap + 1) / 2 and not mask[before, a]
            if jump > least and not known:
                mask[before : behind + _decayed_after(jump / least, period), a] = True
    return mask


def _smallest_jump(samples: Samples, a: int) -> float:
    """Smallest jump of an axis' demand that disturbs its force [m]; inf where the axis rests."""
    measured = np.abs(np.diff(samples.position[samples.valid[:, a], a]))
    return LATE_STEPS * float(measured[measured > 0.0].min()) if measured.any() else math.inf


def _decayed_after(ratio: float, period: float) -> int:
    """Samples until a jump of `ratio` times the smallest one has decayed, including the first."""
    return math.ceil(math.log(ratio) * DECAY / period) + 2


def outliers(samples: Samples, period: float, masses: Sequence[float]) -> NDArray[np.bool_]:
    """Samples whose position contradicts the force around it, after `resampled_to_grid`.

    Time stamps of irregular SYNCs can be microseconds off. At 0.1 m/s, 5 us are 0.5 um: the axis
    appears to jump there and back without any force. Late setpoints that `late_setpoints` cannot
    detect look the same.

    Args:
        samples: of a move.
        period: Ts [s].
        masses: moved by each axis [kg].
    """
    mask = np.zeros(samples.position.shape, dtype=np.bool_)
    known = samples.sync[samples.valid.any(axis=1)]
    if len(known) < _AROUND or np.ptp(known) <= EXACT * period:
        return mask
    for a, mass in enumerate(masses):
        wgap = np.convolve(samples.valid[:, a], np.ones(_AROUND), "valid") == _AROUND
        if not wgap.any():
            continue
        off = np.convolve(samples.position[:, a], _JUMP, "valid")
        off -= period**2 / mass * np.convolve(samples.force[:, a], _BEND, "valid")[1:-1]
        off = np.abs(off)
        usual = float(np.quantile(off[wgap], 0.25)) / _QUARTER
        for k in np.flatnonzero(wgap & (off > OUTLIER * usual)):
            mask[k + 1 : k + 4, a] = True
    return mask


LEAST_SOUND = 0.9
"""With fewer valid samples than this share, there are no courses."""


def prepare_move_data(
    samples: Samples, rest_force: F64, masses: Sequence[float], period: float
) -> tuple[list[MoveData], F64]:
    """One record per axis, and the path of all axes through the gaps.

    Args:
        samples: of the move, from shortly before it on, shape (K, n).
        rest_force: force at rest before the move [N], shape (n,).
        masses: moved by each axis [kg].
        period: Ts [s].

    Returns:
        Records of M >= K samples each, and positions [m], shape (M, n), with straight lines across
        invalid samples.
    """
    punctual = without_stale(without_unpunctual(samples, period))
    masked = late_setpoints(punctual, period)
    data = resampled_to_grid(filled_to_grid(punctual, period), period)
    masked |= missed_syncs(data, period)
    masked |= outliers(data, period, masses)
    records = [
        MoveData(
            data.position[:, a],
            data.force[:, a],
            data.valid[:, a],
            float(data.time[0]),
            float(rest_force[a]),
            masked[:, a],
        )
        for a in range(data.axes)
    ]
    return records, bridged(data.position, data)


def courses(samples: Samples, planned: F64, period: float) -> list[Course]:
    """One for each axis; none where SYNC periods were skipped or too many samples are invalid.

    Args:
        samples: of the move and the rest after it.
        planned: force offsets before their correction [N], shape (K, n).
        period: Ts [s].
    """
    sound = np.count_nonzero(samples.valid)
    if not is_gapless(samples, period) or sound < LEAST_SOUND * samples.valid.size:
        return []
    demand, position = samples.position_demand, bridged(samples.position, samples)
    correction = samples.force_offset - planned
    force = bridged(samples.force, samples)
    return [
        Course(
            demand[:, a],
            position[:, a],
            correction[:, a],
            demand[:, 1 - a] if samples.axes == 2 else np.zeros(len(demand)),
            force[:, a],
        )
        for a in range(samples.axes)
    ]
