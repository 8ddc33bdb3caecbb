"""Stretches of samples that are taken at once: all elements stick, or all slip.

While all stick they are a spring. While all slip they relax at one rate, each towards its share of
what the sum relaxes to: the sums of force and derivatives are led on, and the elements follow from
them at the end. What lies between is `rows`'.
"""

from __future__ import annotations

import numba

from estimation.belief import (
    ALPHA,
    COULOMB,
    RATE,
    STIFFNESS,
)
from estimation.elements import (
    BY_ALPHA,
    BY_COULOMB,
    BY_RATE,
    BY_REST,
    BY_SLIP,
    BY_STIFFNESS,
    BY_TURN,
    FORCE,
    SHARES,
    sum_elements,
)
from estimation.move_tables import (
    FAST,
    MAPPED,
    RESIDUAL,
    REST_FORCE,
    SLIP_FORCE,
    SUBSTEPS,
    T_CURVE,
    T_DECAY,
    T_DECAY_BY_ALPHA,
    T_DECAY_BY_RATE,
    T_GOAL,
    T_GOAL_BY_ALPHA,
    T_GOAL_BY_RATE,
    T_HAZE,
    T_LEVEL,
    T_POSITION,
    T_SLOPE,
    T_STUCK,
    T_UNTIL,
    TURN_FORCE,
)
from estimation.slip_maps import map_samples, map_shape


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def spring(  # type: ignore[no-untyped-def]
    k, direction, coulomb, stiffness, alpha, level_at, wide, tables, columns, elements
):
    """Samples from k on while all elements stick; returns the first that it leaves."""
    n, end = elements.shape[1] - 1, min(int(tables[T_UNTIL, k]), columns.shape[1])
    position = tables[T_POSITION]
    # How far they can surely stretch before the first one slips.
    lowest, room = coulomb * min(1.0, 1.0 + alpha), 1e300
    for i in range(n if direction != 0.0 else 0):
        room = min(room, elements[SHARES, i] * lowest - direction * elements[FORCE, i])
    room /= stiffness
    origin, at = position[k], k
    while at < end and (position[at + 1] - origin) * direction < room:
        at += 1
    total, by_stiffness = elements[FORCE, n], elements[BY_STIFFNESS, n]
    by_coulomb, by_rest = elements[BY_COULOMB, n], elements[BY_REST, n]
    by_turn, by_slip = elements[BY_TURN, n], elements[BY_SLIP, n]
    for j in range(k, at):
        travel = position[j + 1] - origin
        columns[RESIDUAL, j] = total + n * stiffness * travel
        columns[STIFFNESS, j] = by_stiffness + travel
        columns[COULOMB, j] = by_coulomb
        columns[REST_FORCE, j] = by_rest
        columns[TURN_FORCE, j] = by_turn
        columns[SLIP_FORCE, j] = by_slip
        tables[T_STUCK, j] = n * stiffness
        tables[T_LEVEL, j] = level_at
        tables[T_HAZE, j] = 0.0
    if wide:
        for j in range(k, at):
            columns[RATE, j] = elements[BY_RATE, n]
            columns[ALPHA, j] = elements[BY_ALPHA, n]
    elements[SHARES, n] = -1.0
    stretched = position[at] - origin
    elements[FORCE, n] += n * stiffness * stretched
    elements[BY_STIFFNESS, n] += stretched
    for i in range(n):
        elements[FORCE, i] += stiffness * stretched
        elements[BY_STIFFNESS, i] += stretched / n
    return at


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def slip(  # type: ignore[no-untyped-def]
    k, direction, kept, coulomb, rate, alpha, shape, period, wide, tables, ready, columns, elements
):
    """Samples from k on while all slip in one direction; returns the first that it leaves.

    They all relax at one rate, each towards its share of what the sum relaxes to: the sums are led
    on, and the elements follow from them at the end.
    """
    n, at = elements.shape[1] - 1, min(int(tables[T_UNTIL, k]), columns.shape[1])
    decays, goals = tables[T_DECAY], tables[T_GOAL]
    if not ready[at - 1] & MAPPED or not ready[k] & MAPPED:  # else all between are
        map_samples(k, at, direction, kept, rate, alpha, shape, period, tables, ready)
    before, whole = elements[FORCE, n], 1.0  # what an element keeps of its force
    total, by_coulomb = before, elements[BY_COULOMB, n]
    by_stiffness, by_rest = elements[BY_STIFFNESS, n], elements[BY_REST, n]
    by_turn, by_slip = elements[BY_TURN, n], elements[BY_SLIP, n]
    for j in range(k, at):
        decay, goal = decays[j], goals[j]
        total = decay * total + goal * coulomb
        by_coulomb = decay * by_coulomb + goal
        by_stiffness *= decay
        by_rest *= decay
        by_turn *= decay
        by_slip *= decay
        whole *= decay
        columns[RESIDUAL, j] = total
        columns[COULOMB, j] = by_coulomb
        columns[STIFFNESS, j] = by_stiffness
        columns[REST_FORCE, j] = by_rest
        columns[TURN_FORCE, j] = by_turn
        columns[SLIP_FORCE, j] = by_slip
        tables[T_LEVEL, j] = j
    new_coulomb = by_coulomb - whole * elements[BY_COULOMB, n]
    if wide:
        map_shape(k, at, direction, kept, rate, alpha, period, tables, ready)
        _slip_shape(k, at, coulomb, tables, columns, elements)
    for i in range(n):
        part = elements[SHARES, i]
        elements[FORCE, i] = whole * elements[FORCE, i] + part * (total - whole * before)
        elements[BY_COULOMB, i] = whole * elements[BY_COULOMB, i] + part * new_coulomb
        for row in (BY_STIFFNESS, BY_REST, BY_TURN, BY_SLIP):
            elements[row, i] *= whole
    sum_elements(elements)
    for j in range(at - 1, k - 1, -1):
        if not ready[j] & FAST:
            last = SUBSTEPS if tables[T_CURVE + 3, j] > 0.0 else 1
            elements[SHARES, n] = tables[T_CURVE + 2 * (last - 1), j]
            break
    return at


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _slip_shape(k, end, coulomb, tables, columns, elements):  # type: ignore[no-untyped-def]
    """Derivatives by C/Fc and alpha of samples k...end - 1, where all elements slip."""
    n = elements.shape[1] - 1
    decays, goals = tables[T_DECAY], tables[T_GOAL]
    for row, column, decay_row, goal_row in (
        (BY_RATE, RATE, T_DECAY_BY_RATE, T_GOAL_BY_RATE),
        (BY_ALPHA, ALPHA, T_DECAY_BY_ALPHA, T_GOAL_BY_ALPHA),
    ):
        decays_by, goals_by = tables[decay_row], tables[goal_row]
        total, by_shape = elements[FORCE, n], elements[row, n]
        whole, into = 1.0, 0.0  # what an element keeps, and how much of its force goes into it
        for j in range(k, end):
            by_shape = decays[j] * by_shape + decays_by[j] * total + goals_by[j] * coulomb
            into = decays[j] * into + decays_by[j] * whole
            total = decays[j] * total + goals[j] * coulomb
            whole *= decays[j]
            columns[column, j] = by_shape
        new = by_shape - whole * elements[row, n] - into * elements[FORCE, n]
        for i in range(n):
            elements[row, i] = (
                whole * elements[row, i] + into * elements[FORCE, i] + elements[SHARES, i] * new
            )


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def slip_haze(k, end, haze, kept, follows, tables, ready):  # type: ignore[no-untyped-def]
    """T_STUCK and T_HAZE of samples k...end - 1, where all elements slip; returns the last haze."""
    for j in range(k, end):
        tables[T_STUCK, j] = 0.0
        if ready[j] & FAST:
            tables[T_HAZE, j] = 0.0
        else:
            haze = haze * kept * kept + (follows * tables[T_SLOPE, j]) ** 2
            tables[T_HAZE, j] = haze
    return haze
