"""Stretches of samples that are taken at once: all elements stick, or all slip.

While all stick they are a spring. While all slip they relax at one rate, each towards its share of
what the sum relaxes to: the motion alone says how much of a force is kept and how much comes, the
same for the sums of force and derivatives. What lies between is `rows`'.
"""

from __future__ import annotations

from estimation.compiled import kernel
from estimation.friction.elements import (
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
from estimation.online.belief import ALPHA, COULOMB, RATE, STIFFNESS
from estimation.online.move_tables import (
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
    T_GAINED,
    T_GOAL,
    T_GOAL_BY_ALPHA,
    T_GOAL_BY_RATE,
    T_HAZE,
    T_KEPT,
    T_LEVEL,
    T_POSITION,
    T_SINCE,
    T_SLOPE,
    T_STUCK,
    T_UNTIL,
    TURN_FORCE,
)
from estimation.online.slip_transition import map_samples, map_shape


@kernel(forceinline=True)
def spring(  # type: ignore[no-untyped-def]
    k, direction, coulomb, stiffness, alpha, level_at, wide, record, tables, columns, elements
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
    elements[SHARES, n] = -1.0
    if at == k:
        return at
    if record:
        total, by_stiffness = elements[FORCE, n], elements[BY_STIFFNESS, n]
        by_coulomb, by_rest = elements[BY_COULOMB, n], elements[BY_REST, n]
        by_turn, by_slip = elements[BY_TURN, n], elements[BY_SLIP, n]
        residual, by_stiffnesses = columns[RESIDUAL], columns[STIFFNESS]
        by_coulombs, by_rests = columns[COULOMB], columns[REST_FORCE]
        by_turns, by_slips = columns[TURN_FORCE], columns[SLIP_FORCE]
        springs, hazes, levels = tables[T_STUCK], tables[T_HAZE], tables[T_LEVEL]
        for j in range(k, at):
            travel = position[j + 1] - origin
            residual[j] = total + n * stiffness * travel
            by_stiffnesses[j] = by_stiffness + travel
            by_coulombs[j], by_rests[j] = by_coulomb, by_rest
            by_turns[j], by_slips[j] = by_turn, by_slip
            springs[j], hazes[j], levels[j] = n * stiffness, 0.0, level_at
    if wide:
        for j in range(k, at):
            columns[RATE, j] = elements[BY_RATE, n]
            columns[ALPHA, j] = elements[BY_ALPHA, n]
    stretched = position[at] - origin
    elements[FORCE, n] += n * stiffness * stretched
    elements[BY_STIFFNESS, n] += stretched
    for i in range(n):
        elements[FORCE, i] += stiffness * stretched
        elements[BY_STIFFNESS, i] += stretched / n
    return at


@kernel(fastmath={"contract"}, forceinline=True)
def slip(  # type: ignore[no-untyped-def]
    k, direction, kept, coulomb, rate, alpha, shape, period, wide, record, tables, ready, columns,
    elements,
):  # fmt: skip
    """Samples from k on while all slip in one direction; returns the first that it leaves.

    They all relax at one rate, each towards its share of what the sum relaxes to.
    """
    n, at = elements.shape[1] - 1, min(int(tables[T_UNTIL, k]), columns.shape[1])
    # Slices that begin at 0: else every index is looked at for its sign, and no loop vectorised.
    kept_since, gained = tables[T_KEPT, k:at], tables[T_GAINED, k:at]
    if not ready[at - 1] & MAPPED or not ready[k] & MAPPED:  # else all between are
        map_samples(k, at, direction, kept, rate, alpha, shape, period, tables, ready)
        tables[T_SINCE, at - 1] = -1.0
    if tables[T_SINCE, at - 1] != k:
        _follow_on(tables[T_DECAY, k:at], tables[T_GOAL, k:at], kept_since, gained)
        tables[T_SINCE, k:at] = k
    whole, new = kept_since[at - k - 1], gained[at - k - 1]
    if record:
        _relax(elements[FORCE, n], coulomb, kept_since, gained, columns[RESIDUAL, k:at])
        _relax(elements[BY_COULOMB, n], 1.0, kept_since, gained, columns[COULOMB, k:at])
        _keep(elements[BY_STIFFNESS, n], kept_since, columns[STIFFNESS, k:at])
        _keep(elements[BY_REST, n], kept_since, columns[REST_FORCE, k:at])
        _keep(elements[BY_TURN, n], kept_since, columns[TURN_FORCE, k:at])
        _keep(elements[BY_SLIP, n], kept_since, columns[SLIP_FORCE, k:at])
        level = tables[T_LEVEL, k:at]
        for j in range(at - k):
            level[j] = k + j
    if wide:
        map_shape(k, at, direction, kept, rate, alpha, period, tables, ready)
        _slip_shape(k, at, coulomb, tables, columns, elements)
    for i in range(n):
        part = elements[SHARES, i] * new
        elements[FORCE, i] = whole * elements[FORCE, i] + part * coulomb
        elements[BY_COULOMB, i] = whole * elements[BY_COULOMB, i] + part
        for row in (BY_STIFFNESS, BY_REST, BY_TURN, BY_SLIP):
            elements[row, i] *= whole
    sum_elements(elements)
    for j in range(at - 1, k - 1, -1):
        if not ready[j] & FAST:
            last = SUBSTEPS if tables[T_CURVE + 3, j] > 0.0 else 1
            elements[SHARES, n] = tables[T_CURVE + 2 * (last - 1), j]
            break
    return at


@kernel(fastmath={"contract"})
def _follow_on(decays, goals, kept, gained):  # type: ignore[no-untyped-def]
    """What samples do to a force together, up to each of them."""
    # Four parts side by side, as every step waits for the one before; then joined.
    part = kept.shape[0] // 4
    a, b, c, d = decays[:part], decays[part:], decays[2 * part :], decays[3 * part :]
    to_a, to_b, to_c, to_d = goals[:part], goals[part:], goals[2 * part :], goals[3 * part :]
    kept_a, kept_b, kept_c, kept_d = kept[:part], kept[part:], kept[2 * part :], kept[3 * part :]
    gained_a, gained_b = gained[:part], gained[part:]
    gained_c, gained_d = gained[2 * part :], gained[3 * part :]
    whole_a = whole_b = whole_c = whole_d = 1.0
    new_a = new_b = new_c = new_d = 0.0
    for j in range(part):
        whole_a *= a[j]
        whole_b *= b[j]
        whole_c *= c[j]
        whole_d *= d[j]
        new_a = a[j] * new_a + to_a[j]
        new_b = b[j] * new_b + to_b[j]
        new_c = c[j] * new_c + to_c[j]
        new_d = d[j] * new_d + to_d[j]
        kept_a[j], kept_b[j], kept_c[j], kept_d[j] = whole_a, whole_b, whole_c, whole_d
        gained_a[j], gained_b[j], gained_c[j], gained_d[j] = new_a, new_b, new_c, new_d
    for j in range(4 * part, kept.shape[0]):
        whole_d *= decays[j]
        new_d = decays[j] * new_d + goals[j]
        kept[j], gained[j] = whole_d, new_d
    for begin_at in range(part, 4 * part, max(part, 1)):
        end = begin_at + part if begin_at < 3 * part else kept.shape[0]
        _behind(kept[begin_at - 1], gained[begin_at - 1], kept[begin_at:end], gained[begin_at:end])


@kernel(fastmath={"contract"})
def _behind(whole, new, kept, gained):  # type: ignore[no-untyped-def]
    """The same behind other samples."""
    for j in range(kept.shape[0]):
        gained[j] += kept[j] * new
        kept[j] *= whole


@kernel(fastmath={"contract"})
def _relax(before, towards, kept, gained, out):  # type: ignore[no-untyped-def]
    """A force, or a derivative of it, along samples; few rows are what a compiler sees through."""
    for j in range(out.shape[0]):
        out[j] = kept[j] * before + gained[j] * towards


@kernel()
def _keep(before, kept, out):  # type: ignore[no-untyped-def]
    """What is left of a derivative along samples; mostly there was none."""
    for j in range(out.shape[0]):
        out[j] = kept[j] * before


@kernel(fastmath={"contract"})
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


@kernel(forceinline=True)
def slip_haze(k, end, haze, kept, follows, tables, ready):  # type: ignore[no-untyped-def]
    """T_STUCK and T_HAZE of samples k...end - 1, where all elements slip; returns the last haze."""
    springs, hazes = tables[T_STUCK, k:end], tables[T_HAZE, k:end]
    for j in range(end - k):
        springs[j] = 0.0
        hazes[j] = 0.0
    for j in range(k, end):
        if not ready[j] & FAST:
            haze = haze * kept * kept + (follows * tables[T_SLOPE, j]) ** 2
            tables[T_HAZE, j] = haze
    return haze
