"""A move's samples prepared for the solves: cleaned, with kinematics and zones.

Also decides which samples count, and whether the move determines anything in each zone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.friction.law import breakaway_travel, has_presliding
from estimation.kinematics import differences, find_turns
from estimation.online.belief.belief import ALPHA, STIFFNESS
from estimation.online.solver.zones import REST, SLIDE, STICK, mark_zones
from stagedata import F64
from stagedata.compiled import kernel

REST_AFTER = 0.05
"""How much of the rest behind a motion is used [s]."""
LEAST_BACK = 0.005
"""A settling that goes back less than this share of the breakaway travel does not determine sigma0
by itself, without an onset."""
HIDDEN = 0.25
"""Samples that are missing or saturated hide the onset if the motion covers this share of the
breakaway travel meanwhile, or of a shorter way."""
FULL_SLIP = 2.0
"""Least length of a move from which C/Fc is learned, in breakaway travels. In shorter moves not all
elements slip; of their forces only the sum was known at rest, and the rest would bias C/Fc."""
MIN_SLIDE, MIN_STICK = 12, 6
"""Fewest samples of a zone that is worth solving."""

TOO_LITTLE, UNUSABLE_FORCE, UNKNOWN_STATE, HIDDEN_ONSET = range(4)
"""Why there is nothing to solve: too little motion; no usable force while it moves; an unknown
friction state before it; a hidden onset."""


class Sampled(NamedTuple):
    """A move as it was sampled.

    Attributes:
        position: sampled [m], shape (K + 2,).
        force: measured [N], shape (K + 2,).
        valid: samples that can be used, shape (K + 2,).
        disturbed: those of which only the position counts, shape (K + 2,); none: shape (0,).
        rest: position at rest before it [m], used if the first sample is missing; nan: unknown.
        rest_force: measured at rest before it [N].
    """

    position: F64
    force: F64
    valid: NDArray[np.bool_]
    disturbed: NDArray[np.bool_]
    rest: float
    rest_force: float


class Samples(NamedTuple):
    """A move as the solves take it; the inner sample k is sample k + 1.

    Attributes:
        position: without holes [m], shape (K + 2,).
        force: 0 where it is not usable [N], shape (K + 2,).
        velocity: central difference [m/s], shape (K,).
        acceleration: the same [m/s^2], shape (K,).
        heading: direction of motion, +1, -1 or 0 at rest, shape (K,).
        turn_share: where in the interval that ends at the sample the motion turns or stops, 0 to
            1; negative: not in it; shape (K,).
        turn_at: position there [m], shape (K,).
        turn_sharpness: curvature of the turn [m per squared sample], 0 for a stop, shape (K,).
        zone: REST, STICK or SLIDE, shape (K,).
        usable: whether the residual counts, shape (K,).
    """

    position: F64
    force: F64
    velocity: F64
    acceleration: F64
    heading: NDArray[np.int8]
    turn_share: F64
    turn_at: F64
    turn_sharpness: F64
    zone: NDArray[np.int8]
    usable: NDArray[np.bool_]


class Prepared(NamedTuple):
    """Samples of a move, and what can be solved.

    Attributes:
        samples: ready to be solved.
        counted: valid samples.
        slide: usable samples of zone A, 0 where they are too few.
        stick: the same of the stick zones.
        end: up to which inner sample the move is used.
        why: of TOO_LITTLE ... HIDDEN_ONSET, where nothing can be solved.
        steady: share of the motion in which the force was not disturbed.
        onset_seen: it is not hidden by samples that are missing or saturated.
        shows_stiffness: whether the move can determine sigma0.
        far: whether it goes FULL_SLIP.
    """

    samples: Samples
    counted: int
    slide: int
    stick: int
    end: int
    why: int
    steady: float
    onset_seen: bool
    shows_stiffness: bool
    far: bool


@kernel()
def clean(position, force, valid, rest, x, f, good):  # type: ignore[no-untyped-def]
    """Copy the samples, bridging holes in the position by straight lines; returns how many count.

    `position` [m], `force` [N] and `valid`, shape (K,), are read, `x`, `f` and `good` written;
    `rest` is the position before the first one [m], nan where it is not known.
    """
    samples, usable, last = position.shape[0], 0, -1
    # Loops of few arrays, as a compiler sees through.
    for k in range(samples):
        x[k] = position[k]
        usable += abs(position[k]) < math.inf
    for k in range(samples):
        f[k] = force[k]
        usable += abs(force[k]) < math.inf
    for k in range(samples):
        good[k] = valid[k]
        usable += valid[k]
    if usable == 3 * samples:
        return samples
    usable = 0
    for k in range(samples):
        good[k] = valid[k] and abs(position[k]) < math.inf
    for k in range(samples):
        sound = good[k] and abs(force[k]) < math.inf
        f[k] = force[k] if sound else 0.0
        good[k] = sound
        usable += sound
    for k in range(samples if usable < samples else 0):
        if good[k]:
            if last < k - 1:
                # All that it moved stretched its elements, seen or not: from the rest, if known.
                first = max(last, 0)
                begin = x[last] if last >= 0 else rest if math.isfinite(rest) else position[k]
                for j in range(last + 1, k):
                    x[j] = begin + (j - first) / (k - first) * (position[k] - begin)
            last = k
    for j in range(last + 1 if usable < samples else samples, samples):
        x[j] = x[last] if last >= 0 else 0.0
    return usable


@kernel()
def prepare(sampled, axis, law, known, mean, state_known, zone_b):  # type: ignore[no-untyped-def]
    """Kinematics and zones of a move; what can be solved (long: each step once, in order).

    Args:
        sampled: the move.
        axis: settings of the axis.
        law: constants of its friction law.
        known: Coulomb force believed before the move [N].
        mean: belief before it, shape (STATES,).
        state_known: False where only the sum of the internal forces is known: the onset then says
            nothing.
        zone_b: whether the stick zones are solved at all.
    """
    size = sampled.position.shape[0]
    count, disturbed = size - 2, np.zeros(size, np.bool_)
    position, force, good = np.empty(size), np.empty(size), np.empty(size, np.bool_)
    counted = clean(
        sampled.position, sampled.force, sampled.valid, sampled.rest, position, force, good
    )
    for k in range(sampled.disturbed.shape[0]):
        disturbed[k] = sampled.disturbed[k]
    velocity, acceleration, usable = np.empty(count), np.empty(count), np.empty(count, np.bool_)
    differences(position, good, axis.period, velocity, acceleration, usable)
    heading, zone = np.empty(count, np.int8), np.empty(count, np.int8)
    turn_share, turn_at, turn_sharpness = np.empty(count), np.empty(count), np.empty(count)
    find_turns(position, axis.position_noise, heading, turn_share, turn_at, turn_sharpness)
    travel = breakaway_travel(law, known, axis.unit[STIFFNESS] * mean[STIFFNESS], mean[ALPHA])
    mark_zones(position, velocity, heading, travel, law.stribeck_velocity, zone)
    for k in range(count):
        usable[k] &= abs(force[k + 1]) < axis.peak_force and not disturbed[k + 1]
    begun, end = 0, count
    while begun < count and zone[begun] != SLIDE:
        begun += 1
    while end > 0 and zone[end - 1] == REST:
        end -= 1
    way = abs(position[size - 1] - position[0])
    least = HIDDEN * min(travel, way)
    onset_seen = _is_seen(position, force, good, axis.peak_force, begun, least)
    if not has_presliding(law):
        for k in range(count):
            usable[k] &= zone[k] == SLIDE
    sound_slide, sound_stick = (
        _count_usable(zone, usable, SLIDE),
        _count_usable(zone, usable, STICK),
    )
    # An onset says nothing unless it is known how it began, and how elements began to slip.
    onset_counts = state_known and onset_seen
    for k in range(begun if onset_counts else 0, begun):
        usable[k] = False
    back = 0.0 if onset_counts else _way_back(position, heading, zone, begun)
    slide, stick = _count_usable(zone, usable, SLIDE), _count_usable(zone, usable, STICK)
    why = TOO_LITTLE
    if slide < MIN_SLIDE and stick < MIN_STICK:
        unknown = HIDDEN_ONSET if state_known else UNKNOWN_STATE
        why = _why_not(zone, sound_slide, sound_stick, has_presliding(law), unknown)
    return Prepared(
        Samples(
            position, force, velocity, acceleration, heading, turn_share, turn_at, turn_sharpness,
            zone, usable,
        ),
        counted,
        slide if slide >= MIN_SLIDE else 0,
        stick if zone_b and stick >= MIN_STICK else 0,
        min(count, end + int(REST_AFTER / axis.period + 0.5)),
        why,
        _steady_share(zone, disturbed),
        onset_seen,
        # A settling alone, of nanometres, has more than one stiffness that fits.
        onset_counts or back >= LEAST_BACK * travel,
        way > FULL_SLIP * travel,
    )  # fmt: skip


@kernel()
def _is_seen(position, force, good, peak, begun, least):  # type: ignore[no-untyped-def]
    """Whether no samples are missing or saturated while the motion covers `least` [m] of the onset.

    `position` [m], `force` [N] and `good`, shape (K + 2,); `peak` force [N]; `begun`: inner sample
    at which zone A begins. How elements began to slip meanwhile is not known.
    """
    gone, whole = position[0], True
    for k in range(position.shape[0]):
        if good[k] and abs(force[k]) < peak:
            if not whole and abs(position[k] - gone) > least:
                return False
            if k > begun:
                return True
            gone, whole = position[k], True
        else:
            whole = False
    return True


@kernel()
def _why_not(zone, slide, stick, presliding, unknown):  # type: ignore[no-untyped-def]
    """Why nothing can be solved; `zone`: codes, shape (K,).

    `slide`, `stick`: number of samples usable but for an unknown onset; `presliding`: whether the
    law has any, without which samples that stick are none to learn from; `unknown`: why the onset
    does not count.
    """
    if slide >= MIN_SLIDE or stick >= MIN_STICK:
        return unknown
    sliding = sticking = 0
    for k in range(zone.shape[0]):
        sliding += zone[k] == SLIDE
        sticking += presliding and zone[k] == STICK
    return UNUSABLE_FORCE if sliding >= MIN_SLIDE or sticking >= MIN_STICK else TOO_LITTLE


@kernel()
def _way_back(position, heading, zone, begun):  # type: ignore[no-untyped-def]
    """How far the motion returns behind zone A [m].

    `position` [m], shape (K + 2,); `heading` and `zone`, shape (K,); `begun`: where zone A begins.
    """
    farthest = back = direction = 0.0
    for k in range(begun, zone.shape[0]):
        if zone[k] == SLIDE:
            direction, farthest, back = float(heading[k]), position[k + 1], 0.0
        else:
            along = (position[k + 1] - farthest) * direction
            if along > 0.0:
                farthest = position[k + 1]
            back = max(back, -along)
    return back


@kernel()
def _count_usable(zone, usable, wanted):  # type: ignore[no-untyped-def]
    """Number of usable samples in zone `wanted`; `zone` and `usable`, shape (K,)."""
    number = 0
    for k in range(zone.shape[0]):
        number += zone[k] == wanted and usable[k]
    return number


@kernel()
def _steady_share(zone, disturbed):  # type: ignore[no-untyped-def]
    """Share of the samples in motion whose force was not disturbed.

    `zone`, shape (K,); `disturbed`, shape (K + 2,).
    """
    moving = lost = 0
    for k in range(zone.shape[0]):
        moving += zone[k] != REST
        lost += zone[k] != REST and disturbed[k + 1]
    return 1.0 - lost / max(moving, 1)
