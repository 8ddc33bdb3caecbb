"""Residual of a move and its derivatives by every unknown, sample by sample, in one pass.

The model is driven by the measured positions, segment by segment (`zones.find_turns`): inside a
segment the direction is known, an element that slips goes on slipping until the motion turns, and
one that sticks stretches with the position. So nothing is decided by noise, and no dead band is
needed. What a position's error does to a sample follows: through the second difference, through
viscous friction, and through the elements that stick (`T_STUCK`).

Written column by column, (columns, samples): whitening and normal equations then run along
contiguous memory. Three regimes, each a loop of its own: all elements stick (a spring), all slip
(their sum relaxes), and whatever lies between.
"""

from __future__ import annotations

import math

import numba

from estimation.belief import ALPHA, COULOMB, LAG, LEVEL, MASS, RATE, STIFFNESS, VISCOUS
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
    SLIPS,
    begin,
    step_elements,
    stribeck_rise,
    sum_elements,
)
from estimation.gms import FAR_ABOVE, NO_SUBSTEPS

SUBSTEPS = 4
"""Of the friction model inside a sample that is not far above the Stribeck velocity."""

# Unknowns behind the figures of `belief`: force of the elements [N] at rest before the move, behind
# the last turn, and when zone A begins; error of the first position [standard deviations], from
# which all travel is counted. The residual has a column between them and the level's knots.
REST_FORCE, TURN_FORCE, SLIP_FORCE, ORIGIN, RESIDUAL, KNOTS = range(LEVEL, LEVEL + 6)
OFFSETS = 4

# Tables, one row of samples each: of the data (`zones`), then what a pass leaves.
(
    T_POSITION, T_VELOCITY, T_ACCELERATION, T_FORCE, T_SHARE, T_AT, T_SHARP, T_UNTIL, T_STUCK,
    T_SCALE, T_LEVEL, T_HAZE, T_DECAY, T_GOAL, T_DECAY_BY_RATE, T_GOAL_BY_RATE, T_DECAY_BY_ALPHA,
    T_GOAL_BY_ALPHA, T_SLOPE, T_CURVE,
) = range(20)  # fmt: skip
TABLES = T_CURVE + 2 * SUBSTEPS
"""From T_DECAY on what depends on the shape (C/Fc and alpha) and the motion only, kept while they
stay: what a sample does to the force of all elements while they slip, F <- decay F + goal Fc; slope
of exp(-|v/vs|^delta) by v/vs at the sample; that curve and the decay of each substep."""
# What of these is valid, and whether the sample is far above the Stribeck velocity.
MAPPED, CURVED, FAST = 1, 2, 4


@numba.njit(cache=True, error_model="numpy")
def fill_rows(  # type: ignore[no-untyped-def]
    p, knots, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading,
    ready, wide, weigh, columns, elements,
):  # fmt: skip
    """Fill `columns` with the residual (predicted minus measured) and its derivatives.

    Args:
        p: the unknowns, in the order of the columns, shape (KNOTS + knots,).
        knots: of the level, 0 for none.
        figures: what the relative ones of p are relative to, shape (LEVEL,).
        shape: Stribeck velocity [m/s] and exponent.
        noise: rms of a position [m].
        period: of the samples [s].
        start: element forces at rest before the move [N].
        known_coulomb: Coulomb force under which they are known [N].
        rest_force: measured there; the element forces add up to it [N].
        tables: rows T_*, shape (TABLES, samples + 2).
        heading: of `find_turns`, shape (samples,).
        ready: MAPPED, CURVED, FAST, shape (samples,); clear it for another shape.
        wide: whether the derivatives by C/Fc, alpha and lag are wanted.
        weigh: whether T_STUCK, T_HAZE and what is returned are wanted.
        columns: written, shape (KNOTS + knots, samples).
        elements: nu_i in its row, room for the rest, shape (ELEMENT_ROWS, N + 1); left as the state
            at the last sample.

    Returns:
        How uncertain the elements' force is behind the last turn, and where zone A begins, beside
        what follows from an offset of all positions [N].
    """
    doubts = lead(
        p, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading, ready,
        wide, weigh, columns, elements,
    )  # fmt: skip
    pull = -figures[STIFFNESS] * p[STIFFNESS] * noise
    _finish(p, knots, figures, pull, noise / period, period, tables, wide, columns)
    return doubts


@numba.njit(cache=True, error_model="numpy")
def lead(  # type: ignore[no-untyped-def]
    p, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading, ready,
    wide, weigh, columns, elements,
):  # fmt: skip
    """Lead the elements through a move; of each row the sum of their forces and its derivatives.

    Arguments and what it returns: as `fill_rows`.
    """
    count, n = columns.shape[1], elements.shape[1] - 1
    coulomb = figures[COULOMB] * p[COULOMB]
    stiffness = figures[STIFFNESS] * p[STIFFNESS] / n
    rate, alpha = figures[RATE] * p[RATE], p[ALPHA]
    kept = math.exp(-rate * period)
    # Deviation of the limit over the curve's slope, from what noise makes of the velocity.
    error_by_slope = alpha * coulomb * noise * math.sqrt(0.5) / (period * shape[0])
    begin(elements, start, coulomb, alpha, known_coulomb, rest_force)
    doubt = haze = begun = 0.0
    # Not written as 0 and False: numba would compile anew what takes them, for constants.
    level_at, k, slid, stuck = n - n, n - n, n < 0, n
    while k < count:
        direction = float(heading[k])
        turn = tables[T_SHARE, k]
        if stuck == n:
            reached = _spring(
                k, direction, coulomb, stiffness, alpha, level_at, wide, tables, columns, elements,
            )  # fmt: skip
            if reached > k:
                k = reached
                continue
        elif stuck == 0 and turn < 0.0:
            begin_at, k = k, _slip(
                k, direction, kept, coulomb, rate, alpha, shape, period, wide, tables, ready,
                columns, elements,
            )  # fmt: skip
            if weigh:
                haze = _haze(begin_at, k, haze, kept, (1.0 - kept) * error_by_slope, tables, ready)
            level_at = k - 1
            continue
        stuck, relaxed, haze = _between(
            k, haze, kept, error_by_slope, coulomb, stiffness, rate, alpha, shape, noise, period,
            tables, heading, ready, elements,
        )  # fmt: skip
        if stuck == 0 and not slid:  # zone A begins
            slid, begun, haze = True, haze, 0.0
            for i in range(n):
                elements[BY_SLIP, i] = elements[SHARES, i]
            elements[BY_SLIP, n] = 1.0
        if relaxed > 0.0:
            doubt = max(doubt, math.sqrt(relaxed * relaxed + haze))
            haze = 0.0
        if stuck < n:
            level_at = k
        columns[RESIDUAL, k] = elements[FORCE, n]
        columns[COULOMB, k] = elements[BY_COULOMB, n]
        columns[STIFFNESS, k] = elements[BY_STIFFNESS, n]
        columns[REST_FORCE, k] = elements[BY_REST, n]
        columns[TURN_FORCE, k] = elements[BY_TURN, n]
        columns[SLIP_FORCE, k] = elements[BY_SLIP, n]
        if wide:
            columns[RATE, k] = elements[BY_RATE, n]
            columns[ALPHA, k] = elements[BY_ALPHA, n]
        tables[T_STUCK, k] = stuck * stiffness
        tables[T_LEVEL, k] = level_at
        tables[T_HAZE, k] = haze + relaxed * relaxed
        k += 1
    return doubt, math.sqrt(begun)


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _spring(  # type: ignore[no-untyped-def]
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
def _slip(  # type: ignore[no-untyped-def]
    k, direction, kept, coulomb, rate, alpha, shape, period, wide, tables, ready, columns, elements
):
    """Samples from k on while all slip in one direction; returns the first that it leaves.

    They all relax at one rate, each towards its share of what the sum relaxes to: the sums are led
    on, and the elements follow from them at the end.
    """
    n, at = elements.shape[1] - 1, min(int(tables[T_UNTIL, k]), columns.shape[1])
    decays, goals = tables[T_DECAY], tables[T_GOAL]
    if not ready[at - 1] & MAPPED or not ready[k] & MAPPED:  # else all between are
        _map(k, at, direction, kept, rate, alpha, shape, period, tables, ready)
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
        _map_shape(k, at, direction, kept, rate, alpha, period, tables, ready)
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
def _haze(k, end, haze, kept, follows, tables, ready):  # type: ignore[no-untyped-def]
    """T_STUCK and T_HAZE of samples k...end - 1, where all elements slip; returns the last haze."""
    for j in range(k, end):
        tables[T_STUCK, j] = 0.0
        if ready[j] & FAST:
            tables[T_HAZE, j] = 0.0
        else:
            haze = haze * kept * kept + (follows * tables[T_SLOPE, j]) ** 2
            tables[T_HAZE, j] = haze
    return haze


@numba.njit(cache=True, error_model="numpy")
def _map(begin_at, end, direction, kept, rate, alpha, shape, period, tables, ready):  # type: ignore[no-untyped-def]
    """What each sample does to the force of all elements while they slip."""
    vs, fast = shape[0], shape[0] * FAR_ABOVE ** (1.0 / shape[1])
    velocity, decays, goals = tables[T_VELOCITY], tables[T_DECAY], tables[T_GOAL]
    for k in range(begin_at, end):
        if ready[k] & MAPPED:
            continue
        lowest = min(velocity[max(k - 1, 0)] * direction, velocity[k] * direction)
        ready[k] |= MAPPED
        if lowest > fast:  # the curve is 1 there
            decays[k], goals[k] = kept, direction * (1.0 - kept)
            ready[k] |= FAST
            continue
        if not ready[k] & CURVED:
            _curve(k, direction, rate, alpha, shape, period, tables, ready)
        decay, goal = 1.0, 0.0
        for j in range(SUBSTEPS if lowest <= NO_SUBSTEPS * vs else 1):
            part = tables[T_CURVE + 2 * j + 1, k]
            limit = direction * (1.0 + alpha * tables[T_CURVE + 2 * j, k])
            goal = limit + (goal - limit) * part
            decay *= part
        decays[k], goals[k] = decay, goal


@numba.njit(cache=True, error_model="numpy")
def _map_shape(begin_at, end, direction, kept, rate, alpha, period, tables, ready):  # type: ignore[no-untyped-def]
    """Derivatives of `_map` by C/Fc and alpha."""
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


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _decay(x):  # type: ignore[no-untyped-def]
    """exp(-x); what is small, as it mostly is, by its series: exact, and quicker."""
    if x > 0.05:
        return math.exp(-x)
    total = 1.0
    for j in range(8, 0, -1):
        total = 1.0 - total * (x * (1.0 / j))
    return total


@numba.njit(cache=True, error_model="numpy")
def _curve(k, direction, rate, alpha, shape, period, tables, ready):  # type: ignore[no-untyped-def]
    """Stribeck curve and decay of each substep of a sample, and the curve's slope at its end."""
    vs, delta = shape[0], shape[1]
    v1 = tables[T_VELOCITY, k]
    v0 = tables[T_VELOCITY, k - 1] if k > 0 else v1
    steps = SUBSTEPS if min(v0 * direction, v1 * direction) <= NO_SUBSTEPS * vs else 1
    shift = (tables[T_POSITION, k + 1] - tables[T_POSITION, k]) / period - 0.5 * (v0 + v1)
    tables[T_CURVE + 3, k] = 0.0  # no second one
    relaxed, part = rate * period / steps, 1.0 / steps
    for j in range(steps):
        v = v0 + (v1 - v0) * ((j + 0.5) * part) + shift
        rise = stribeck_rise(abs(v) / vs, delta)
        tables[T_CURVE + 2 * j, k] = rise
        tables[T_CURVE + 2 * j + 1, k] = _decay(relaxed / (1.0 + alpha * rise))
    ratio = abs(v1) / vs
    slope = delta * stribeck_rise(ratio, delta)
    tables[T_SLOPE, k] = slope if delta == 1.0 else slope * ratio ** (delta - 1.0)
    ready[k] |= CURVED


@numba.njit(cache=True, error_model="numpy", forceinline=True)
def _between(  # type: ignore[no-untyped-def]
    k, haze, kept, error_by_slope, coulomb, stiffness, rate, alpha, shape, noise, period, tables,
    heading, ready, elements,
):  # fmt: skip
    """One sample of any kind.

    Returns how many elements stick, the force that a turn leaves open [N], and `haze`: variance of
    the force from what a position's error does to the Stribeck curve [N^2].
    """
    n = elements.shape[1] - 1
    x0, x1 = tables[T_POSITION, k], tables[T_POSITION, k + 1]
    v1 = tables[T_VELOCITY, k]
    v0 = tables[T_VELOCITY, k - 1] if k > 0 else v1
    turn = tables[T_SHARE, k]
    heading_now = float(heading[k])
    vs, delta = shape[0], shape[1]
    if elements[SHARES, n] < 0.0:
        elements[SHARES, n] = _rise_before(k, vs, delta, period, tables)
    if turn < 0.0:
        landed = slack = 0.0
        slow = min(v0 * heading_now, v1 * heading_now) <= NO_SUBSTEPS * vs
        steps = SUBSTEPS if slow else 1
        dt = period / steps
        shift = (x1 - x0) / period - 0.5 * (v0 + v1)
        if not ready[k] & CURVED:
            _curve(k, heading_now, rate, alpha, shape, period, tables, ready)
        for j in range(steps):
            v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
            some, loose = step_elements(
                v * dt, heading_now, tables[T_CURVE + 2 * j, k], tables[T_CURVE + 2 * j + 1, k],
                dt, coulomb, stiffness, rate, alpha, elements,
            )  # fmt: skip
            landed += some
            slack += loose
        stuck = sum_elements(elements)
        # An element that lands takes the curve's error, one that slips follows it slowly.
        error = error_by_slope * tables[T_SLOPE, k]
        slid = (1.0 - kept) * (n - stuck) / n
        haze = haze * kept * kept + (landed * landed + slid * slid) * error * error
        haze += (slack * noise) ** 2
        return stuck, 0.0, haze
    backward = k > 0 and float(heading[k - 1]) == -heading_now
    old = -heading_now if backward else heading_now
    at = tables[T_AT, k]
    dt = turn * period / SUBSTEPS
    for j in range(SUBSTEPS if turn > 0.0 else 0):
        left = 1.0 - (j + 0.5) / SUBSTEPS  # the velocity falls to nothing
        rise = stribeck_rise(abs(v0) * left / vs, delta)
        step_elements(
            (at - x0) * 2.0 * left / SUBSTEPS, old, rise,
            math.exp(-rate * dt / (1.0 + alpha * rise)), dt, coulomb, stiffness, rate, alpha,
            elements,
        )  # fmt: skip
    relaxed = 0.0
    for i in range(n):
        if elements[SLIPS, i] > 0.0:
            limit = elements[SHARES, i] * coulomb * (1.0 + alpha)
            relaxed += abs(old * limit - elements[FORCE, i])
            elements[SLIPS, i] = 0.0
            elements[BY_TURN, i] = 1.0 / n
    relaxed *= 1.0 - kept
    sharp = tables[T_SHARP, k]
    relaxed *= min(0.5, noise / sharp) if sharp > 0.0 else 0.5
    if turn < 1.0:
        elements[SHARES, n] = 1.0
        rise = stribeck_rise(abs(0.5 * v1) / vs, delta)
        dt = (1.0 - turn) * period
        step_elements(
            x1 - at, -old, rise, math.exp(-rate * dt / (1.0 + alpha * rise)), dt, coulomb,
            stiffness, rate, alpha, elements,
        )  # fmt: skip
    return sum_elements(elements), relaxed, haze


@numba.njit(cache=True, error_model="numpy")
def _rise_before(k, vs, delta, period, tables):  # type: ignore[no-untyped-def]
    """Stribeck rise in the last substep before sample k: where the next one's limits begin."""
    velocity, position = tables[T_VELOCITY], tables[T_POSITION]
    if k == 0:
        return stribeck_rise(abs(velocity[0]) / vs, delta)
    v1 = velocity[k - 1]
    v0 = velocity[k - 2] if k > 1 else v1
    steps = SUBSTEPS if min(abs(v0), abs(v1)) <= NO_SUBSTEPS * vs else 1
    v = (position[k] - position[k - 1]) / period + (v1 - v0) * (steps - 1) / (2 * steps)
    return stribeck_rise(abs(v) / vs, delta)


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def _finish(p, knots, figures, pull, swing, period, tables, wide, columns):  # type: ignore[no-untyped-def]
    """The rest of each row: what is linear in the data, units, and the level's knots.

    `pull` and `swing` are what the first position's error does: a force on all elements [N], and a
    velocity [m/s].
    """
    count = columns.shape[1]
    force, scale, residual = tables[T_FORCE], tables[T_SCALE], columns[RESIDUAL]
    _scale(columns[COULOMB], figures[COULOMB], columns[COULOMB])
    _scale(columns[STIFFNESS], figures[STIFFNESS], columns[STIFFNESS])
    _scale(tables[T_VELOCITY], figures[VISCOUS], columns[VISCOUS])
    _scale(tables[T_ACCELERATION], figures[MASS], columns[MASS])
    _scale(columns[REST_FORCE], pull, columns[ORIGIN])
    # The first row has this error in its second difference too.
    columns[ORIGIN, 0] += swing * (
        figures[MASS] * p[MASS] / period - 0.5 * figures[VISCOUS] * p[VISCOUS]
    )
    _add(columns[VISCOUS], p[VISCOUS], columns[MASS], p[MASS], residual)
    _add(columns[REST_FORCE], p[REST_FORCE], columns[TURN_FORCE], p[TURN_FORCE], residual)
    _add(columns[SLIP_FORCE], p[SLIP_FORCE], columns[ORIGIN], p[ORIGIN], residual)
    for k in range(count):
        residual[k] -= force[k + 1]
    if wide:
        lag = p[LAG]
        for k in range(count):
            columns[RATE, k] *= figures[RATE]
            slope = 0.5 * (force[k + 2] - force[k])
            bend = force[k + 2] - 2.0 * force[k + 1] + force[k]
            residual[k] -= lag * (slope + 0.5 * lag * bend)
            columns[LAG, k] = -(slope + lag * bend)
    if knots > 0:
        _scale(columns[COULOMB], p[COULOMB], scale)
        for j in range(knots):
            for k in range(count):
                columns[KNOTS + j, k] = 0.0
        for k in range(count):
            place = tables[T_LEVEL, k] * (knots - 1) / (tables.shape[1] - 3)
            knot = min(int(place), knots - 2)
            share = place - knot
            columns[KNOTS + knot, k] = scale[k] * (1.0 - share)
            columns[KNOTS + knot + 1, k] = scale[k] * share
            residual[k] += scale[k] * (
                p[KNOTS + knot] * (1.0 - share) + p[KNOTS + knot + 1] * share
            )


@numba.njit(cache=True, error_model="numpy")
def _scale(row, factor, out):  # type: ignore[no-untyped-def]
    """A row in other units; few rows at a time are what a compiler sees through."""
    for k in range(min(row.shape[0], out.shape[0])):
        out[k] = factor * row[k]


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _add(a, by_a, b, by_b, total):  # type: ignore[no-untyped-def]
    """Add two columns times their unknowns."""
    for k in range(total.shape[0]):
        total[k] += by_a * a[k] + by_b * b[k]
