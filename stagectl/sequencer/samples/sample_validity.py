"""Which samples of a move the estimator can use, and at which instants they were taken.

A drive samples when SYNC reaches it (CiA 301). That can be off the grid for two reasons: SYNC left
early or late, which the host measures and `resampled_to_grid` corrects; or SYNC took longer than
usual on the bus, which only the arrival of the answer bounds (`without_unpunctual`).
"""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from stagedata import F64, Samples
from stagedata.compiled import kernel

PUNCTUAL = 0.01
"""The instant of a sample must be known to this share of Ts."""
EXACT = 1e-5
"""A SYNC off its place by less than this share of Ts counts as exactly on it."""
REACH = 0.3
"""Samples taken within this share of Ts of their place are interpolated to it."""
STALE_STEPS = 20
"""A jump by this many of the axis' smallest steps shows that it moved while samples repeated."""

_NODES, _SPREAD = 4, 5
"""Samples used to interpolate a position, and the number of periods they may span."""


def without_late(samples: Samples) -> Samples:
    """Mark samples of late SYNCs as invalid, and those that answer an earlier SYNC.

    Where two samples arrive for one SYNC after a missed one, the drive was delayed, and the first
    of them answers an earlier SYNC.
    """
    if samples.valid.all() and not samples.late.any():
        return samples
    valid = samples.valid & ~samples.late[:, None]
    valid[1:-1] &= (samples.extra[2:] == 0) | samples.valid[:-2]
    return replace(samples, valid=valid)


def mean_force(samples: Samples) -> F64:
    """Mean force of each axis over its valid samples, or over all if none is valid [N]."""
    means = []
    for values, valid in zip(samples.force.T.tolist(), samples.valid.T.tolist(), strict=True):
        used = [value for value, ok in zip(values, valid, strict=True) if ok] or values
        means.append(sum(used) / len(used))
    return np.array(means)


def bridged(values: F64, samples: Samples) -> F64:
    """Values of all axes with straight lines across invalid samples, shape (K, n)."""
    if samples.valid.all():
        return values
    index = np.arange(len(samples))
    columns = [
        np.interp(index, index[ok], own[ok]) if ok.any() else own
        for own, ok in zip(values.T, samples.valid.T, strict=True)
    ]
    return np.column_stack(columns)


def without_unpunctual(samples: Samples, period: float) -> Samples:
    """Mark samples as invalid whose SYNC may have reached the drive off its usual delay.

    SYNC arrived before its answer and, where the host knows that, before sending it had returned.
    The deviation of this bound from its median bounds how far the sample is off its instant. At
    10 mm/s, 10 us are 0.1 um, which looks like 2 N on 8 kg; 15 us either way put estimates off by
    more than their sigma.

    Args:
        samples: of a move.
        period: Ts [s].
    """
    if widest_spread(samples.arrival, samples.doubt, samples.valid) <= PUNCTUAL * period:
        return samples
    valid = samples.valid.copy()
    for arrival, ok in zip(samples.arrival.T, valid.T, strict=True):
        if ok.any():
            bound = np.fmin(arrival, samples.doubt)
            ok &= np.abs(bound - np.median(bound[ok])) <= PUNCTUAL * period
    return replace(samples, valid=valid)


@kernel()
def widest_spread(arrival, doubt, valid):  # type: ignore[no-untyped-def]
    """How far any axis' bounds on the delay of SYNC are apart [s].

    `arrival` and `valid`, (K, n); `doubt`, (K,); as of `Samples`.
    """
    widest = 0.0
    for a in range(arrival.shape[1]):
        least, most = math.inf, -math.inf
        for k in range(arrival.shape[0]):
            if valid[k, a]:
                bound = min(arrival[k, a], doubt[k])
                least, most = min(least, bound), max(most, bound)
        widest = max(widest, most - least)
    return widest


def without_stale(samples: Samples) -> Samples:
    """Mark samples as invalid that repeat the previous one although the axis moved on.

    A drive that sends old data repeats position and force to the last bit, then the position jumps.
    """
    valid = samples.valid.copy()
    if not unmark_stale(samples.position, samples.force, valid):
        return samples
    return replace(samples, valid=valid)


@kernel()
def unmark_stale(position, force, valid):  # type: ignore[no-untyped-def]
    """`without_stale`: take what is stale out of `valid`; whether there was any. Shapes (K, n)."""
    found = False
    for a in range(position.shape[1]):
        smallest, last = math.inf, -1
        for k in range(position.shape[0]):
            if valid[k, a]:
                step = abs(position[k, a] - position[last, a]) if last >= 0 else 0.0
                smallest = min(smallest, step) if step > 0.0 else smallest
                last = k
        last, first = -1, -1  # of samples that are alike
        for k in range(position.shape[0]):
            if not valid[k, a]:
                continue
            step = abs(position[k, a] - position[last, a])
            if last >= 0 and step == 0.0 and force[k, a] == force[last, a]:
                first = k if first < 0 else first
            else:
                if first >= 0 and step > STALE_STEPS * smallest:
                    valid[first:k, a] = False
                    found = True
                first = -1
            last = k
    return found


def grid_places(samples: Samples, period: float) -> NDArray[np.int64]:
    """Index of each SYNC on the grid, from the first one on, shape (K,)."""
    return np.asarray(np.round((samples.time - samples.time[0]) / period), dtype=np.int64)


def is_gapless(samples: Samples, period: float) -> bool:
    """Whether there is a sample for every SYNC period from the first one on."""
    return round(float(samples.time[-1] - samples.time[0]) / period) == len(samples) - 1


def filled_to_grid(samples: Samples, period: float) -> Samples:
    """Insert an invalid row for every skipped SYNC period."""
    if is_gapless(samples, period):
        return samples
    place = grid_places(samples, period)
    count = int(place[-1]) + 1
    whole = Samples.missing(count, samples.axes)
    for field in fields(Samples):
        getattr(whole, field.name)[place] = getattr(samples, field.name)
    return replace(whole, time=samples.time[0] + period * np.arange(count))


def resampled_to_grid(samples: Samples, period: float) -> Samples:
    """Interpolate samples to the instants at which SYNC was due, after `filled_to_grid`.

    Positions by the cubic through the four samples around, forces by the line through two. A sample
    without such neighbours becomes invalid, unless its offset is negligible.

    Args:
        samples: of a move.
        period: Ts [s].
    """
    if not samples.valid.any() or np.ptp(samples.sync) <= EXACT * period:
        return samples
    off = (samples.sync - np.median(samples.sync[samples.valid.any(axis=1)])) / period
    moved = np.abs(off) > EXACT
    if not (moved[:, None] & samples.valid).any():
        return samples
    position, force, valid = samples.position.copy(), samples.force.copy(), samples.valid.copy()
    valid[np.abs(off) > REACH] = False
    for a in range(position.shape[1]):
        rows = np.flatnonzero(valid[:, a])
        at = np.flatnonzero(moved[rows])
        if len(rows) < _NODES:
            valid[rows[at], a] = False
            continue
        first, near = _neighbours(rows, at, off[rows[at]] > 0)
        alone = rows[at[~near]]
        valid[alone[np.abs(off[alone]) > PUNCTUAL], a] = False
        at, first = at[near], first[near]
        here = rows[at]
        nodes = rows[first[:, None] + np.arange(_NODES)]
        position[here, a] = _polynomial_at_zero(
            nodes + off[nodes] - here[:, None], samples.position[nodes, a]
        )
        two = np.clip(at - (off[here] > 0), 0, len(rows) - 2)
        nodes = rows[two[:, None] + np.arange(2)]
        force[here, a] = _polynomial_at_zero(
            nodes + off[nodes] - here[:, None], samples.force[nodes, a]
        )
    return replace(samples, position=position, force=force, valid=valid)


def _neighbours(
    rows: NDArray[np.int64], at: NDArray[np.int64], before: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """First interpolation node of each sample in `rows`, and whether its nodes are close enough.

    Args:
        rows: indices of valid samples, in order.
        at: indices into `rows` of the samples to interpolate.
        before: whether the place on the grid is before the sample.
    """
    starts = np.clip(at[:, None] - np.arange(_NODES), 0, len(rows) - _NODES)
    spread = rows[starts + _NODES - 1] - rows[starts]
    off_centre = np.abs(at[:, None] - starts - 1 - before[:, None])
    best = np.argmin(spread + 0.1 * off_centre, axis=1)[:, None]
    first = np.take_along_axis(starts, best, axis=1)[:, 0]
    return first, np.take_along_axis(spread, best, axis=1)[:, 0] <= _SPREAD


def _polynomial_at_zero(place: F64, value: F64) -> F64:
    """Value at 0 of the polynomials through (place, value), both shape (m, nodes): shape (m,)."""
    origin = value[:, :1]
    total = origin[:, 0].copy()
    for i in range(place.shape[1]):
        weight = np.ones(len(place))
        for j in range(place.shape[1]):
            if j != i:
                weight *= place[:, j] / (place[:, j] - place[:, i])
        total += weight * (value[:, i] - origin[:, 0])
    return total
