"""What a host that is late does to the samples of a move: whose force says nothing, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stagectl.sequencer.samples import EXACT, MoveSamples

UPSET, UPSET_STEPS = 0.03, 100
"""A SYNC that is off its place by more than this share of Ts lets the drive's demand stand still,
and jump; what the axis would have gone meanwhile matters from so many of its smallest steps on."""
FADES = 1e-3
"""How fast the drive's answer to such a jump fades, by 1/e [s]: what is fast in it, by its
derivative's low-pass. The rest of the answer changes little within a sample period."""
ASIDE = 8.0
"""Something is amiss where a position is so many standard deviations off what its neighbours and
the force say."""

_QUARTER = 0.3186  # of normal absolute values, over their standard deviation; most may be upset
_HALF = 0.6745  # median of the same
_BEND = np.array([1.0, -2.0, 1.0])
_JUMP = np.convolve(_BEND, _BEND)
_AROUND = len(_JUMP)


def upset(samples: MoveSamples, period: float) -> NDArray[np.bool_]:
    """Samples of which the force says nothing, on the grid, shape (places, n).

    A drive that gets its setpoints late stands still in its demand, and then jumps. The force
    that follows changes within a sample period: what is sampled of it isn't what accelerates
    the axis. With setpoints 0.15 ms late at 0.1 m/s it is off by 5 N, on 8 kg.

    Args:
        samples: of a move.
        period: Ts [s].
    """
    place = samples.places(period)
    away = np.abs(samples.sync - np.median(samples.sync))
    still = np.where(away > UPSET * period, away, 0.0)
    passed = np.diff(place, prepend=place[0] - 1) - 1
    still += period * passed
    mask = np.zeros((int(place[-1]) + 1, samples.position.shape[1]), dtype=np.bool_)
    late = np.flatnonzero(still)
    if not len(late):
        return mask
    for a, position in enumerate(samples.bridged().T):
        least = _least(samples, a)
        step = np.abs(np.diff(position))
        speed = np.append(step, 0.0) / np.append(np.diff(place), 1)
        for k in late:
            jump = float(speed[max(k - 3, 0) : k + 1].max() * still[k] / period)
            if jump > least:
                mask[
                    max(place[k] - passed[k] - 1, 0) : place[k] + _fades(jump / least, period), a
                ] = True
    return mask


def kicked(samples: MoveSamples, period: float) -> NDArray[np.bool_]:
    """The same where SYNC did not reach the drive; `on_grid` already.

    A sample that stays away may have been lost on its way here, which does no harm, or it was never
    taken, and the setpoint not taken over either. Then the drive stood still in its demand as long
    as the hole is, and its force behind the hole is another than the one before leads to expect.

    Args:
        samples: of a move, shape (K, n).
        period: Ts [s].
    """
    mask = np.zeros(samples.position.shape, dtype=np.bool_)
    for a, valid in enumerate(samples.valid.T):
        rows = np.flatnonzero(valid)
        apart = np.diff(rows)
        holes = np.flatnonzero(apart > 1)
        force, position = samples.force[rows, a], samples.position[rows, a]
        if not len(holes) or len(rows) < _AROUND:
            continue
        least = _least(samples, a)
        steps = np.diff(force) / apart
        bends = np.abs(np.diff(steps))[(apart[1:] == 1) & (apart[:-1] == 1)]
        finest = np.abs(steps[steps != 0.0])
        if not len(bends) or not len(finest):
            continue
        usual = max(float(np.median(bends)) / _HALF, float(finest.min()))
        speed = np.abs(np.diff(position)) / apart
        for i in holes[holes > 0]:
            before, behind, hole = rows[i], rows[i + 1], apart[i]
            off = abs(force[i + 1] - force[i] - steps[i - 1] * hole)
            jump = float(speed[max(i - 3, 0) : i + 1].max() * (hole - 1))
            known = off <= ASIDE * usual * hole * (hole + 1) / 2 and not mask[before, a]
            if jump > least and not known:
                mask[before : behind + _fades(jump / least, period), a] = True
    return mask


def _least(samples: MoveSamples, a: int) -> float:
    """From which jump of an axis' demand on its force says nothing [m]; inf where it rests."""
    measured = np.abs(np.diff(samples.position[samples.valid[:, a], a]))
    return UPSET_STEPS * float(measured[measured > 0.0].min()) if measured.any() else math.inf


def _fades(times: float, period: float) -> int:
    """Samples until a jump so many times the least one doesn't matter, the first one included."""
    return math.ceil(math.log(times) * FADES / period) + 2


def aside(samples: MoveSamples, period: float, masses: Sequence[float]) -> NDArray[np.bool_]:
    """Samples whose position does not go with the force around it; on the grid, placed.

    SYNCs that come at uneven times have time stamps, and some of those are microseconds off. At
    0.1 m/s, 5 us are 0.5 um: the axis seems to jump there and back, and no force did it. Jolts that
    `upset` doesn't know of show the same way.

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
        whole = np.convolve(samples.valid[:, a], np.ones(_AROUND), "valid") == _AROUND
        if not whole.any():
            continue
        off = np.convolve(samples.position[:, a], _JUMP, "valid")
        off -= period**2 / mass * np.convolve(samples.force[:, a], _BEND, "valid")[1:-1]
        off = np.abs(off)
        usual = float(np.quantile(off[whole], 0.25)) / _QUARTER
        for k in np.flatnonzero(whole & (off > ASIDE * usual)):
            mask[k + 1 : k + 4, a] = True
    return mask
