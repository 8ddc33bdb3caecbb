"""What a move's samples are before anything is solved: clean, with kinematics and zones.

Which samples count, and whether the move can tell anything of each zone.
"""

from __future__ import annotations

import math

import numba

from estimation.belief import ALPHA, STIFFNESS
from estimation.move_tables import (
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
from estimation.update_tables import (
    C_PEAK,
    C_PERIOD,
    C_POSITION_NOISE,
    C_VS,
    F_UNIT,
    R_BOUND,
    R_END,
    R_FAR,
    R_KNOWN,
    R_SLIDE,
    R_STEADY,
    R_STICK,
    R_TOLD,
)
from estimation.zones import REST, SLIDE, STICK, differences, find_stretches, find_turns, mark_zones

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


@numba.njit(cache=True, error_model="numpy")
def clean(position, force, valid, rest, x, f, good):  # type: ignore[no-untyped-def]
    """Copy the samples; holes in the position are bridged by a straight line. Returns how many."""
    samples, usable, last = position.shape[0], 0, -1
    # Two loops of few arrays, as a compiler sees through.
    for k in range(samples):
        x[k] = position[k]
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


@numba.njit(cache=True, error_model="numpy")
def rounding_step(force, noise):  # type: ignore[no-untyped-def]
    """The step that all forces are whole multiples of, where it alone makes the noise; else 0.

    A force noise that is nothing but rounding has a step of sqrt(12) times its rms.
    """
    step = noise * math.sqrt(12.0)
    if not step > 0.0:
        return 0.0
    first = force[0]
    for k in range(force.shape[0]):
        codes = (force[k] - first) / step
        if not abs(codes - math.floor(codes + 0.5)) < 1e-3:
            return 0.0
    return step


@numba.njit(cache=True, error_model="numpy")
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
    mark_zones(position, velocity, heading, travel, constants[C_VS], zone)
    slide = stick = seen = end = moving = shaken = 0
    peak = constants[C_PEAK]
    farthest = back = direction = 0.0
    told, gone = state_known, position[0]
    for k in range(count):
        if valid[k]:
            # How elements began to slip inside a hole nobody knows.
            if k > 0 and not valid[k - 1] and abs(position[k] - gone) > HIDDEN * travel:
                told = False
            gone = position[k]
        if abs(force[k + 1]) >= peak or upset[k + 1]:
            usable[k] = False
        seen += zone[k] == SLIDE
        if zone[k] != REST:
            end = k + 1
            moving += 1
            shaken += upset[k + 1] != 0
        if zone[k] != SLIDE and not told and seen == 0:
            usable[k] = False
        if usable[k]:
            slide += zone[k] == SLIDE
            stick += zone[k] == STICK
        if zone[k] == SLIDE:
            direction, farthest, back = float(heading[k]), position[k + 1], 0.0
        elif seen > 0:
            along = (position[k + 1] - farthest) * direction
            if along > 0.0:
                farthest = position[k + 1]
            back = max(back, -along)
    report[R_SLIDE] = slide if slide >= MIN_SLIDE else 0.0
    report[R_STICK] = stick if zone_b and stick >= MIN_STICK else 0.0
    report[R_BOUND] = -1.0
    report[R_STEADY] = 1.0 - shaken / max(moving, 1)
    # A settling alone, of nanometres, has more than one stiffness that fits.
    report[R_TOLD] = state_known or back >= TOLD * travel
    report[R_FAR] = abs(position[count + 1] - position[0]) > FULL_SLIP * travel
    report[R_END] = min(count, end + int(REST_AFTER / period + 0.5))
