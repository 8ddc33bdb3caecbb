"""Velocity, acceleration and turns of a motion, from sampled positions alone.

Central differences: no lag, and no filter that would bias the estimate. Where the motion turns
comes from positions with hysteresis, never from the sign of a noisy velocity: what slides goes on
sliding until its position has turned.
"""

from __future__ import annotations

import numpy as np

from stagedata import F64
from stagedata.compiled import kernel

REVERSAL_BAND = 3e-9
"""Motion back by this much is a reversal [m] ..."""
REVERSAL_NOISE = 3.5
"""... if it is this many standard deviations of a position. Elements stick again after any
reversal, however small: with a coarser band they would slip on where the stage creeps to rest."""
CREEP, CREEP_NOISE = 3, 6.0
"""Where CREEP samples stay within CREEP_NOISE standard deviations of one, the motion has stopped
there: it springs back by less than the noise, but elements that slipped have stuck."""
PAUSE, CREPT_NOISE, STOP_NOISE = 2, 1.5, 4.5
"""It has also stopped where PAUSE samples gain less than CREPT_NOISE standard deviations: that
hides a reversal, whatever comes next. It stopped at the sample after which no step gains as much;
up to there elements slip, and near rest, up the Stribeck curve, they gain 1 % of their force in
1 ms. The last stop is detected well above the noise (STOP_NOISE): a millisecond too many spoils
Fc more than one too few."""
REST_NOISE = 9.0
"""Positions that stay within this many standard deviations are at rest."""
BLOCK = 32
"""Number of samples skipped at once in fast motion."""


def slope(path: F64, period: float) -> F64:
    """Central differences of samples, shape (K,), one-sided at the ends; 0 of a single sample."""
    return np.gradient(path, period) if len(path) > 1 else np.zeros(len(path))


@kernel()
def differences(position, valid, period, velocity, acceleration, usable):  # type: ignore[no-untyped-def]
    """Central differences at inner samples, and where all three samples are valid.

    `position` [m] and `valid`, shape (K + 2,), are read, `period` in s; `velocity` [m/s],
    `acceleration` [m/s^2] and `usable`, shape (K,), written.
    """
    half, square = 0.5 / period, 1.0 / period**2
    for k in range(velocity.shape[0]):
        before, this, after = position[k], position[k + 1], position[k + 2]
        velocity[k] = (after - before) * half
        acceleration[k] = ((after - this) - (this - before)) * square
        usable[k] = valid[k] and valid[k + 1] and valid[k + 2]


@kernel()
def find_turns(position, noise, heading, share, at, sharpness):  # type: ignore[no-untyped-def]
    """Direction of motion at each inner sample, and where it turns or stops (one long scan).

    Args:
        position: sampled [m], shape (K + 2,); inner sample k is sample k + 1.
        noise: rms of a position [m].
        heading: written: direction, +1 or -1; 0 at rest before and after the motion; shape (K,).
        share: written: at which part of the interval that ends at the sample the motion turned or
            stopped; -1 where it did not; shape (K,).
        at: written: position there [m], shape (K,).
        sharpness: written: curvature of the turn [m per squared sample], 0 for a stop, shape (K,).
    """
    count = heading.shape[0]
    last = count + 1
    rest = REST_NOISE * noise
    band, creep = max(REVERSAL_BAND, REVERSAL_NOISE * noise), CREEP_NOISE * noise
    for k in range(count):
        heading[k] = 0
        share[k] = -1.0
    # Rest before: all within the band of the first sample. Rest after: the longest such end.
    first = 0
    while first <= last and abs(position[first] - position[0]) <= rest:
        first += 1
    if first > last:
        return
    stop = last
    low = high = position[last]
    while stop > first:
        x = position[stop - 1]
        low, high = min(low, x), max(high, x)
        if high - low > rest:
            break
        stop -= 1
    direction = 1 if position[first] > position[first - 1] else -1
    turned, extreme = first - 1, position[first - 1]
    since = first  # first sample of this direction
    i = first - 1
    while i < stop:
        if turned == i:  # fast motion has no turns to find
            while i + BLOCK + PAUSE <= stop and _advances(
                position[i : i + BLOCK + PAUSE + 1], direction, creep
            ):
                i += BLOCK
            turned, extreme = i, position[i]
        i += 1
        if (
            i > since
            and i + CREEP <= stop
            and (
                _creeps(position, i, creep)
                or abs(position[i + PAUSE] - position[i]) < CREPT_NOISE * noise
            )
        ):
            # Too slow for a direction: the elements stick until it has moved on visibly.
            i = _end_of_creep(position, i, stop, direction, CREPT_NOISE * noise)
            heading[since - 1 : i] = direction
            share[i - 1], at[i - 1], sharpness[i - 1] = 1.0, position[i], 0.0
            anchor = position[i]
            while i < stop and abs(position[i] - anchor) <= rest:
                i += 1
            since, direction = i, 1 if position[i] > anchor else -1
            turned, extreme = i, position[i]
            continue
        along = (position[i] - extreme) * direction
        if along >= 0.0:
            turned, extreme = i, position[i]
        elif along < -band:
            heading[since - 1 : turned] = direction
            if 1 <= turned <= count:
                _vertex(position, turned, direction, noise, share, at, sharpness)
            since, direction = turned + 1, -direction
            turned, extreme = i, position[i]
    stop = _end_of_creep(position, stop, last, direction, STOP_NOISE * noise)
    heading[since - 1 : stop] = direction
    if stop <= count and share[stop - 1] < 0.0:
        share[stop - 1], at[stop - 1], sharpness[stop - 1] = 1.0, position[stop], 0.0


@kernel()
def _advances(position, direction, least):  # type: ignore[no-untyped-def]
    """Whether every step of `position` [m], shape (n,), is more than `least` [m] forward."""
    slow = 0
    for j in range(position.shape[0] - 1):
        slow += not (position[j + 1] - position[j]) * direction > least
    return slow == 0


@kernel()
def _creeps(position, i, band):  # type: ignore[no-untyped-def]
    """Whether the CREEP samples behind sample i of `position` [m] stay within `band` [m] of it."""
    for j in range(i + 1, i + CREEP + 1):
        if abs(position[j] - position[i]) > band:
            return False
    return True


@kernel()
def _end_of_creep(position, i, last, direction, least):  # type: ignore[no-untyped-def]
    """First sample from i on (at most `last`) whose next step is less than `least` [m] forward.

    `position` [m], shape (K,); `direction`: +1 or -1.
    """
    while i < last and (position[i + 1] - position[i]) * direction > least:
        i += 1
    return i


@kernel()
def _vertex(position, turned, direction, noise, share, at, sharpness):  # type: ignore[no-untyped-def]
    """The turning point near its farthest sample `turned`: vertex of a parabola through three.

    `position` [m], shape (K + 2,); `direction` before the turn; `noise`: rms of a position [m];
    `share`, `at` and `sharpness`, shape (K,), are written as in `find_turns`.
    """
    before, this, after = position[turned - 1], position[turned], position[turned + 1]
    curvature = (2.0 * this - before - after) * direction
    slope = 0.5 * (after - before) * direction
    when, where = 0.0, this
    if curvature > 6.0 * noise:
        when = min(max(slope / curvature, -0.5), 0.5)
        where = this + direction * 0.5 * slope * when
    if when > 0.0 and turned < share.shape[0]:
        share[turned], at[turned], sharpness[turned] = when, where, curvature
    else:
        share[turned - 1], at[turned - 1], sharpness[turned - 1] = (
            1.0 + min(when, 0.0),
            where,
            curvature,
        )
