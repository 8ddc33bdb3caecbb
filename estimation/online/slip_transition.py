"""What a sample does to the force of all elements while they slip: F <- decay F + goal Fc.

It depends on the motion, the Stribeck curve, C/Fc and alpha, not on the forces, so it is made once
per move and kept while those stay; near the Stribeck velocity out of SUBSTEPS exact exponential
steps along the interpolated velocity.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel
from estimation.friction.elements import stribeck_rise
from estimation.friction.gms import FAR_ABOVE, NO_SUBSTEPS
from estimation.online.move_tables import (
    CURVED,
    FAST,
    MAPPED,
    SUBSTEPS,
    T_CURVE,
    T_DECAY,
    T_DECAY_BY_ALPHA,
    T_DECAY_BY_RATE,
    T_GOAL,
    T_GOAL_BY_ALPHA,
    T_GOAL_BY_RATE,
    T_POSITION,
    T_SLOPE,
    T_VELOCITY,
)

SMALL = 0.05
"""Up to there eight terms of exp(-x) are exact."""


@kernel()
def map_samples(begin_at, end, direction, kept, rate, alpha, shape, period, tables, ready):  # type: ignore[no-untyped-def]
    """What each sample does to the force of all elements while they slip."""
    vs, fast = shape[0], shape[0] * FAR_ABOVE ** (1.0 / shape[1])
    velocity, decays, goals = tables[T_VELOCITY], tables[T_DECAY], tables[T_GOAL]
    # Far above the Stribeck velocity the curve is 1: mostly that is one run, filled at once.
    first, last = begin_at, end
    while first < end and not _lowest(velocity, first, direction) > fast:
        first += 1
    while last > first and not _lowest(velocity, last - 1, direction) > fast:
        last -= 1
    if _slow(velocity[max(first - 1, 0) : last], direction, fast) > 0:
        last = first
    _fill_run(
        kept, direction * (1.0 - kept), decays[first:last], goals[first:last], ready[first:last]
    )
    for at in range(begin_at, end - (last - first)):
        k = at if at < first else at + (last - first)
        if ready[k] & MAPPED:
            continue
        lowest = _lowest(velocity, k, direction)
        ready[k] |= MAPPED
        if lowest > fast:  # the curve is 1 there
            decays[k], goals[k] = kept, direction * (1.0 - kept)
            ready[k] |= FAST
            continue
        if not ready[k] & CURVED:
            follow_curve(k, direction, rate, alpha, shape, period, tables, ready)
        decay, goal = 1.0, 0.0
        for j in range(SUBSTEPS if lowest <= NO_SUBSTEPS * vs else 1):
            part = tables[T_CURVE + 2 * j + 1, k]
            limit = direction * (1.0 + alpha * tables[T_CURVE + 2 * j, k])
            goal = limit + (goal - limit) * part
            decay *= part
        decays[k], goals[k] = decay, goal


@kernel()
def _lowest(velocity, k, direction):  # type: ignore[no-untyped-def]
    """Least speed from the sample before to this one."""
    return min(velocity[max(k - 1, 0)] * direction, velocity[k] * direction)


@kernel()
def _slow(velocity, direction, fast):  # type: ignore[no-untyped-def]
    """How many samples are not above a speed."""
    count = 0
    for j in range(velocity.shape[0]):
        count += not velocity[j] * direction > fast
    return count


@kernel()
def _fill_run(decay, goal, decays, goals, ready):  # type: ignore[no-untyped-def]
    """The map of samples that are all far above the Stribeck velocity."""
    for j in range(decays.shape[0]):
        decays[j] = decay
        goals[j] = goal
    for j in range(ready.shape[0]):
        ready[j] |= MAPPED | FAST


@kernel()
def map_shape(begin_at, end, direction, kept, rate, alpha, period, tables, ready):  # type: ignore[no-untyped-def]
    """Derivatives of `map_samples` by C/Fc and alpha."""
    for k in range(begin_at, end):
        decay, goal = 1.0, 0.0
        decay_by_rate = goal_by_rate = decay_by_alpha = goal_by_alpha = 0.0
        far = (ready[k] & FAST) != 0
        steps = SUBSTEPS if not far and tables[T_CURVE + 3, k] > 0.0 else 1
        for j in range(steps):
            rise, part = tables[T_CURVE + 2 * j, k], tables[T_CURVE + 2 * j + 1, k]
            if far:
                rise, part = 0.0, kept
            curve = 1.0 + alpha * rise
            limit, rising = direction * curve, direction * rise
            by_rate = -part * period / steps / curve
            by_alpha = -by_rate * rate * rise / curve
            decay_by_rate = decay_by_rate * part + decay * by_rate
            decay_by_alpha = decay_by_alpha * part + decay * by_alpha
            goal_by_rate = goal_by_rate * part + (goal - limit) * by_rate
            goal_by_alpha = rising + (goal_by_alpha - rising) * part + (goal - limit) * by_alpha
            goal = limit + (goal - limit) * part
            decay *= part
        tables[T_DECAY_BY_RATE, k], tables[T_GOAL_BY_RATE, k] = decay_by_rate, goal_by_rate
        tables[T_DECAY_BY_ALPHA, k], tables[T_GOAL_BY_ALPHA, k] = decay_by_alpha, goal_by_alpha


@kernel(fastmath={"contract"})
def follow_curve(k, direction, rate, alpha, shape, period, tables, ready):  # type: ignore[no-untyped-def]
    """Stribeck curve and decay of each substep of a sample, and the curve's slope at its end."""
    vs, delta = shape[0], shape[1]
    v1 = tables[T_VELOCITY, k]
    v0 = tables[T_VELOCITY, k - 1] if k > 0 else v1
    slow = min(v0 * direction, v1 * direction) <= NO_SUBSTEPS * vs
    part = 1.0 / SUBSTEPS if slow else 1.0
    shift = (tables[T_POSITION, k + 1] - tables[T_POSITION, k]) / period - 0.5 * (v0 + v1)
    relaxed, gained = rate * period * part, (v1 - v0) * part
    first = v0 + 0.5 * gained + shift
    last = first + (SUBSTEPS - 1) * gained
    even = delta == 1.0 and 0.0 < first * last < (FAR_ABOVE * vs) ** 2
    if slow and even and relaxed <= SMALL * min(1.0, 1.0 + alpha):
        # The velocity goes by equal steps, the curve by equal factors.
        rise = math.exp(-abs(first) / vs)
        by = math.exp((abs(first) - abs(last)) / (vs * (SUBSTEPS - 1)))
        second, third, fourth = rise * by, rise * (by * by), (rise * by) * (by * by)
        _put(rise, _small_decay(relaxed / (1.0 + alpha * rise)), T_CURVE, k, tables)
        _put(second, _small_decay(relaxed / (1.0 + alpha * second)), T_CURVE + 2, k, tables)
        _put(third, _small_decay(relaxed / (1.0 + alpha * third)), T_CURVE + 4, k, tables)
        _put(fourth, _small_decay(relaxed / (1.0 + alpha * fourth)), T_CURVE + 6, k, tables)
    else:
        rise = stribeck_rise(abs(first) / vs, delta)
        _put(rise, math.exp(-relaxed / (1.0 + alpha * rise)), T_CURVE, k, tables)
        tables[T_CURVE + 3, k] = 0.0  # no second one
        for j in range(1, SUBSTEPS if slow else 1):
            rise = stribeck_rise(abs(first + j * gained) / vs, delta)
            _put(rise, math.exp(-relaxed / (1.0 + alpha * rise)), T_CURVE + 2 * j, k, tables)
    ratio = abs(v1) / vs
    slope = delta * stribeck_rise(ratio, delta)
    tables[T_SLOPE, k] = slope if delta == 1.0 else slope * ratio ** (delta - 1.0)
    ready[k] |= CURVED


@kernel()
def _put(rise, decay, row, k, tables):  # type: ignore[no-untyped-def]
    tables[row, k] = rise
    tables[row + 1, k] = decay


@kernel(fastmath={"contract"})
def _small_decay(x):  # type: ignore[no-untyped-def]
    """exp(-x) of what is SMALL, as it mostly is, by its series: exact, and quicker."""
    # In pairs that do not wait for each other.
    square = x * x
    low = (1.0 - x) + (1.0 / 2.0 - 1.0 / 6.0 * x) * square
    high = (1.0 / 24.0 - 1.0 / 120.0 * x) + (1.0 / 720.0 - 1.0 / 5040.0 * x) * square
    return low + square * square * high


@kernel()
def rise_before(k, vs, delta, period, tables):  # type: ignore[no-untyped-def]
    """Stribeck rise in the last substep before sample k: where the next one's limits begin."""
    velocity, position = tables[T_VELOCITY], tables[T_POSITION]
    if k == 0:
        return stribeck_rise(abs(velocity[0]) / vs, delta)
    v1 = velocity[k - 1]
    v0 = velocity[k - 2] if k > 1 else v1
    steps = SUBSTEPS if min(abs(v0), abs(v1)) <= NO_SUBSTEPS * vs else 1
    v = (position[k] - position[k - 1]) / period + (v1 - v0) * (steps - 1) / (2 * steps)
    return stribeck_rise(abs(v) / vs, delta)
