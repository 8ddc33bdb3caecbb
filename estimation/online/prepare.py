"""What a move's samples are before anything is solved: clean, with kinematics and zones.

Which samples count, and whether the move can tell anything of each zone.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel
from estimation.kinematics import differences, find_stretches, find_turns
from estimation.online.belief import ALPHA, STIFFNESS
from estimation.online.move_tables import (
    M_GOOD,
    M_HEADING,
    M_UPSET,
    M_USABLE,
    M_ZONE,
    T_ACCELERATION,
    T_AT,
    T_FORCE,
    T_POSITION,
    T_SHARE,
    T_SHARP,
    T_UNTIL,
    T_VELOCITY,
)
from estimation.online.update_tables import (
    C_PEAK,
    C_PERIOD,
    C_POSITION_NOISE,
    C_VS,
    F_UNIT,
    MUTE,
    R_BOUND,
    R_END,
    R_FAR,
    R_KNOWN,
    R_SLIDE,
    R_STEADY,
    R_STICK,
    R_TOLD,
    R_WHY,
    UNBEGUN,
)
from estimation.online.zones import REST, SLIDE, STICK, mark_zones

REST_AFTER = 0.05
"""How much of the rest behind a motion is used [s]."""
TOLD = 0.005
"""A settling that goes back less than this share of the breakaway travel does not tell sigma0 by
itself, without an onset."""
HIDDEN = 0.25
"""A hole in which an onset goes this share of the breakaway travel hides how what follows began."""
FULL_SLIP = 2.0
"""C/Fc is learned from moves of so many breakaway travels and more: shorter ones end among elements
of which only the sum was known at rest, and what that leaves open would go into it."""
MIN_SLIDE, MIN_STICK = 12, 6
"""Fewest samples of a zone that is worth solving."""


@kernel()
def clean(position, force, valid, rest, x, f, good):  # type: ignore[no-untyped-def]
    """Copy the samples; holes in the position are bridged by a straight line. Returns how many."""
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
def prepare(  # type: ignore[no-untyped-def]
    constants, units, shares, mean, state_known, zone_b, tables, marks, report
):
    """Kinematics and zones of a move; which samples count, and what can be solved.

    Args:
        constants: C_*.
        units: what the figures are relative to, their lowest and highest values, shape (3, LEVEL).
        shares: nu_i.
        mean: belief before the move.
        state_known: False where only the sum of the element forces is known: the onset then says
            nothing.
        zone_b: whether the stick zones are solved at all.
        tables: positions and forces are there, shape (TABLES, K); the other T_* of the data are
            written.
        marks: which samples are sound in M_GOOD, and in M_UPSET those whose force says nothing,
            though their position counts; the other M_* written, shape (MARKS, K).
        report: R_*; R_KNOWN is there, what can be solved is written.
    """
    count = tables.shape[1] - 2
    heading, zone, usable = marks[M_HEADING, :count], marks[M_ZONE, :count], marks[M_USABLE, :count]
    valid, upset = marks[M_GOOD], marks[M_UPSET]
    period, noise = constants[C_PERIOD], constants[C_POSITION_NOISE]
    position, force, velocity = tables[T_POSITION], tables[T_FORCE], tables[T_VELOCITY, :count]
    differences(position, valid, period, velocity, tables[T_ACCELERATION, :count], usable)
    find_turns(
        position, noise, heading, tables[T_SHARE, :count], tables[T_AT, :count],
        tables[T_SHARP, :count],
    )  # fmt: skip
    find_stretches(heading, tables[T_SHARE], tables[T_UNTIL])
    n = shares.shape[0]
    travel = (
        shares[n - 1] * (1.0 + mean[ALPHA]) * report[R_KNOWN] * n
        / (units[F_UNIT, STIFFNESS] * mean[STIFFNESS])
    )  # fmt: skip
    mark_zones(position, velocity, heading, tables[T_UNTIL, :count], travel, constants[C_VS], zone)
    _drop(force[1:], upset[1:], constants[C_PEAK], usable)
    begun, end = 0, count
    while begun < count and zone[begun] != SLIDE:
        begun += 1
    while end > 0 and zone[end - 1] == REST:
        end -= 1
    sound = _tally(zone, usable, upset[1:])
    # An onset of which it is not known how it began says nothing.
    for k in range(_lost(position, valid, HIDDEN * travel) if state_known else 0, begun):
        usable[k] = False
    back = 0.0 if state_known else _way_back(position, heading, zone, begun)
    slide, stick, moving, shaken = _tally(zone, usable, upset[1:])
    report[R_SLIDE] = slide if slide >= MIN_SLIDE else 0.0
    report[R_STICK] = stick if zone_b and stick >= MIN_STICK else 0.0
    if slide < MIN_SLIDE and stick < MIN_STICK:
        report[R_WHY] = _why_not(zone, sound[0], sound[1])
    report[R_BOUND] = -1.0
    report[R_STEADY] = 1.0 - shaken / max(moving, 1)
    # A settling alone, of nanometres, has more than one stiffness that fits.
    report[R_TOLD] = state_known or back >= TOLD * travel
    report[R_FAR] = abs(position[count + 1] - position[0]) > FULL_SLIP * travel
    report[R_END] = min(count, end + int(REST_AFTER / period + 0.5))


@kernel()
def _drop(force, upset, peak, usable):  # type: ignore[no-untyped-def]
    """Leave out samples whose force is saturated or upset."""
    for k in range(usable.shape[0]):
        usable[k] &= abs(force[k]) < peak
    for k in range(usable.shape[0]):
        usable[k] &= upset[k] == 0


@kernel()
def _lost(position, valid, least):  # type: ignore[no-untyped-def]
    """The sample behind the first hole in which the motion goes so far; how many where none does.

    How elements began to slip inside it nobody knows.
    """
    sound, count = valid.shape[0] - valid.shape[0], position.shape[0] - 2
    for k in range(count):
        sound += valid[k] != 0
    gone = position[0]
    for k in range(count if sound < count else 0):
        if valid[k]:
            if k > 0 and not valid[k - 1] and abs(position[k] - gone) > least:
                return k
            gone = position[k]
    return count


@kernel()
def _why_not(zone, slide, stick):  # type: ignore[no-untyped-def]
    """Why a move with so many samples that could be used has nothing to solve."""
    if slide >= MIN_SLIDE or stick >= MIN_STICK:
        return UNBEGUN
    sliding = sticking = 0
    for k in range(zone.shape[0]):
        sliding += zone[k] == SLIDE
        sticking += zone[k] == STICK
    return MUTE if sliding >= MIN_SLIDE or sticking >= MIN_STICK else 0.0


@kernel()
def _way_back(position, heading, zone, begun):  # type: ignore[no-untyped-def]
    """How far the motion goes back behind zone A [m]."""
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
def _tally(zone, usable, upset):  # type: ignore[no-untyped-def]
    """Usable samples of zone A and of the stick zones; samples that move, and upset ones."""
    slide = stick = moving = shaken = 0
    for k in range(zone.shape[0]):
        slide += (zone[k] == SLIDE) & (usable[k] != 0)
        stick += (zone[k] == STICK) & (usable[k] != 0)
    for k in range(zone.shape[0]):
        moving += zone[k] != REST
        shaken += (zone[k] != REST) & (upset[k] != 0)
    return slide, stick, moving, shaken
