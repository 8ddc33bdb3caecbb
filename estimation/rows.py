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
    T_POSITION, T_VELOCITY, T_ACCELERATION, T_FORCE, T_SHARE, T_AT, T_SHARP, T_STUCK, T_SCALE,
    T_LEVEL, T_HAZE, T_SLOPE, T_CURVE,
) = range(13)  # fmt: skip
TABLES = T_CURVE + 2 * SUBSTEPS
"""The last ones: slope of exp(-|v/vs|^delta) by v/vs at the sample, then that curve and the decay
of each substep, kept while the shape stays."""


@numba.njit(cache=True, error_model="numpy")
def fill_rows(  # type: ignore[no-untyped-def]
    p, knots, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading,
    ready, wide, columns, elements,
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
        ready: which columns of T_CURVE are valid, shape (samples,); clear it for another shape.
        wide: whether the derivatives by C/Fc, alpha and lag are wanted.
        columns: written, shape (KNOTS + knots, samples).
        elements: nu_i in its row, room for the rest, shape (ELEMENT_ROWS, N + 1); left as the state
            at the last sample.

    Returns:
        How uncertain the elements' force is behind the last turn, and where zone A begins, beside
        what follows from an offset of all positions [N].
    """
    doubts = lead(
        p, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading, ready,
        columns, elements,
    )  # fmt: skip
    pull = -figures[STIFFNESS] * p[STIFFNESS] * noise
    _finish(p, knots, figures, pull, noise / period, period, tables, wide, columns)
    return doubts


@numba.njit(cache=True, error_model="numpy")
def lead(  # type: ignore[no-untyped-def]
    p, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading, ready,
    columns, elements,
):  # fmt: skip
    """Lead the elements through a move; of each row the sum of their forces and its derivatives.

    Arguments and what it returns: as `fill_rows`.
    """
    count, n = columns.shape[1], elements.shape[1] - 1
    coulomb = figures[COULOMB] * p[COULOMB]
    stiffness = figures[STIFFNESS] * p[STIFFNESS] / n
    rate, alpha = figures[RATE] * p[RATE], p[ALPHA]
    begin(elements, start, coulomb, alpha, known_coulomb, rest_force)
    doubt = haze = begun = 0.0
    # Not written as 0 and False: numba would compile anew what takes them, for constants.
    level_at, k, slid, stuck = n - n, n - n, n < 0, n
    while k < count:
        direction = float(heading[k])
        turn = tables[T_SHARE, k]
        if stuck == n:
            room = (
                1e9 if direction == 0.0 else _room(elements, coulomb, stiffness, alpha, direction)
            )
            reached = _spring(
                k, direction, room, stiffness, level_at, tables, heading, columns, elements
            )
            if reached > k:
                k = reached
                continue
        elif stuck == 0 and turn < 0.0:
            k, haze = _slip(
                k, haze, coulomb, rate, alpha, shape, noise, period, tables, heading, ready,
                columns, elements,
            )  # fmt: skip
            level_at = k - 1
            continue
        stuck, relaxed, haze = _between(
            k, haze, coulomb, stiffness, rate, alpha, shape, noise, period, tables, heading, ready,
            elements,
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
        columns[RATE, k] = elements[BY_RATE, n]
        columns[ALPHA, k] = elements[BY_ALPHA, n]
        tables[T_STUCK, k] = stuck * stiffness
        tables[T_LEVEL, k] = level_at
        tables[T_HAZE, k] = haze + relaxed * relaxed
        k += 1
    return doubt, math.sqrt(begun)


@numba.njit(cache=True, error_model="numpy")
def _room(elements, coulomb, stiffness, alpha, direction):  # type: ignore[no-untyped-def]
    """How far the elements can surely stretch before the first one slips [m]."""
    lowest = coulomb * min(1.0, 1.0 + alpha)
    room = 1e9
    for i in range(elements.shape[1] - 1):
        room = min(room, elements[SHARES, i] * lowest - direction * elements[FORCE, i])
    return room / stiffness


@numba.njit(cache=True, error_model="numpy")
def _spring(k, direction, room, stiffness, level_at, tables, heading, columns, elements):  # type: ignore[no-untyped-def]
    """Samples from k on while all elements stick; returns the first that it leaves."""
    count, n = columns.shape[1], elements.shape[1] - 1
    position, share = tables[T_POSITION], tables[T_SHARE]
    origin, stretched = position[k], 0.0
    total, by_stiffness = elements[FORCE, n], elements[BY_STIFFNESS, n]
    at = k
    while at < count and heading[at] == direction and share[at] < 0.0:
        travel = position[at + 1] - origin
        if travel * direction >= room:
            break
        stretched = travel
        columns[RESIDUAL, at] = total + n * stiffness * travel
        columns[STIFFNESS, at] = by_stiffness + travel
        at += 1
    for j in range(k, at):
        columns[COULOMB, j] = elements[BY_COULOMB, n]
        columns[REST_FORCE, j] = elements[BY_REST, n]
        columns[TURN_FORCE, j] = elements[BY_TURN, n]
        columns[SLIP_FORCE, j] = elements[BY_SLIP, n]
        columns[RATE, j] = elements[BY_RATE, n]
        columns[ALPHA, j] = elements[BY_ALPHA, n]
        tables[T_STUCK, j] = n * stiffness
        tables[T_LEVEL, j] = level_at
        tables[T_HAZE, j] = 0.0
    elements[SHARES, n] = -1.0
    elements[FORCE, n] += n * stiffness * stretched
    elements[BY_STIFFNESS, n] += stretched
    for i in range(n):
        elements[FORCE, i] += stiffness * stretched
        elements[BY_STIFFNESS, i] += stretched / n
    return at


@numba.njit(cache=True, error_model="numpy")
def _slip(  # type: ignore[no-untyped-def]
    k, haze, coulomb, rate, alpha, shape, noise, period, tables, heading, ready, columns, elements
):
    """Samples from k on while all slip in one direction.

    They all relax at one rate, each towards its share of what the sum relaxes to: the sums are led
    on, and the elements follow from them at the end.

    Returns:
        The first sample that it leaves, and `haze` there (see `_between`).
    """
    count, n = columns.shape[1], elements.shape[1] - 1
    velocity, share = tables[T_VELOCITY], tables[T_SHARE]
    direction = float(heading[k])
    fast = shape[0] * FAR_ABOVE ** (1.0 / shape[1])
    kept = math.exp(-rate * period)
    follows = (1.0 - kept) * _error_by_slope(alpha * coulomb, noise, period, shape[0])
    total, by_coulomb = elements[FORCE, n], elements[BY_COULOMB, n]
    by_stiffness, by_rest = elements[BY_STIFFNESS, n], elements[BY_REST, n]
    by_turn, by_slip = elements[BY_TURN, n], elements[BY_SLIP, n]
    by_rate, by_alpha = elements[BY_RATE, n], elements[BY_ALPHA, n]
    # What an element keeps of its force, and by how much that goes into its derivatives.
    whole, into_rate, into_alpha = 1.0, 0.0, 0.0
    at = k
    v0 = velocity[k - 1] if k > 0 else velocity[k]
    while at < count and heading[at] == direction and share[at] < 0.0:
        lowest = min(v0 * direction, velocity[at] * direction)
        v0 = velocity[at]
        if lowest > fast:  # the curve is 1 there
            limit = direction * coulomb
            away = (total - limit) * kept
            total = limit + away
            by_coulomb = direction + (by_coulomb - direction) * kept
            by_rate = by_rate * kept - away * period
            by_stiffness *= kept
            by_rest *= kept
            by_turn *= kept
            by_slip *= kept
            by_alpha *= kept
            whole *= kept
            into_rate = into_rate * kept - whole * period
            into_alpha *= kept
            tables[T_HAZE, at] = 0.0
        else:
            if not ready[at]:
                _curve(at, direction, rate, alpha, shape, period, tables, ready)
            steps = SUBSTEPS if lowest <= NO_SUBSTEPS * shape[0] else 1
            dt = period / steps
            for j in range(steps):
                rise, decay = tables[T_CURVE + 2 * j, at], tables[T_CURVE + 2 * j + 1, at]
                curve = 1.0 + alpha * rise
                goal, rising = direction * curve, direction * rise * coulomb
                slower = rate * dt * rise / (curve * curve)
                away = (total - goal * coulomb) * decay
                total = goal * coulomb + away
                by_coulomb = goal + (by_coulomb - goal) * decay
                by_rate = by_rate * decay - away * dt / curve
                by_alpha = rising + (by_alpha - rising) * decay + away * slower
                by_stiffness *= decay
                by_rest *= decay
                by_turn *= decay
                by_slip *= decay
                whole *= decay
                into_rate = into_rate * decay - whole * dt / curve
                into_alpha = into_alpha * decay + whole * slower
                elements[SHARES, n] = rise
            haze = haze * kept * kept + (follows * tables[T_SLOPE, at]) ** 2
            tables[T_HAZE, at] = haze
        columns[RESIDUAL, at] = total
        columns[COULOMB, at] = by_coulomb
        columns[STIFFNESS, at] = by_stiffness
        columns[REST_FORCE, at] = by_rest
        columns[TURN_FORCE, at] = by_turn
        columns[SLIP_FORCE, at] = by_slip
        columns[RATE, at] = by_rate
        columns[ALPHA, at] = by_alpha
        tables[T_STUCK, at] = 0.0
        tables[T_LEVEL, at] = at
        at += 1
    before = elements[FORCE, n]
    new_coulomb = by_coulomb - whole * elements[BY_COULOMB, n]
    new_rate = by_rate - whole * elements[BY_RATE, n] - into_rate * before
    new_alpha = by_alpha - whole * elements[BY_ALPHA, n] - into_alpha * before
    for i in range(n):
        part, force = elements[SHARES, i], elements[FORCE, i]
        elements[FORCE, i] = whole * force + part * (total - whole * before)
        elements[BY_COULOMB, i] = whole * elements[BY_COULOMB, i] + part * new_coulomb
        elements[BY_RATE, i] = whole * elements[BY_RATE, i] + into_rate * force + part * new_rate
        elements[BY_ALPHA, i] = (
            whole * elements[BY_ALPHA, i] + into_alpha * force + part * new_alpha
        )
        for row in (BY_STIFFNESS, BY_REST, BY_TURN, BY_SLIP):
            elements[row, i] *= whole
    sum_elements(elements)
    return at, haze


@numba.njit(cache=True, error_model="numpy")
def _curve(k, direction, rate, alpha, shape, period, tables, ready):  # type: ignore[no-untyped-def]
    """Stribeck curve and decay of each substep of a sample, and the curve's slope at its end."""
    vs, delta = shape[0], shape[1]
    v1 = tables[T_VELOCITY, k]
    v0 = tables[T_VELOCITY, k - 1] if k > 0 else v1
    steps = SUBSTEPS if min(v0 * direction, v1 * direction) <= NO_SUBSTEPS * vs else 1
    shift = (tables[T_POSITION, k + 1] - tables[T_POSITION, k]) / period - 0.5 * (v0 + v1)
    for j in range(steps):
        v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
        rise = stribeck_rise(abs(v) / vs, delta)
        tables[T_CURVE + 2 * j, k] = rise
        tables[T_CURVE + 2 * j + 1, k] = math.exp(-rate * period / steps / (1.0 + alpha * rise))
    ratio = abs(v1) / vs
    slope = delta * stribeck_rise(ratio, delta)
    tables[T_SLOPE, k] = slope if delta == 1.0 else slope * ratio ** (delta - 1.0)
    ready[k] = True


@numba.njit(cache=True, error_model="numpy")
def _error_by_slope(rising, noise, period, vs):  # type: ignore[no-untyped-def]
    """Deviation of the limit [N] over the curve's slope: from what noise makes of the velocity."""
    return rising * noise * math.sqrt(0.5) / (period * vs)


@numba.njit(cache=True, error_model="numpy")
def _between(  # type: ignore[no-untyped-def]
    k, haze, coulomb, stiffness, rate, alpha, shape, noise, period, tables, heading, ready, elements
):
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
        if not ready[k]:
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
        error = _error_by_slope(alpha * coulomb, noise, period, vs) * tables[T_SLOPE, k]
        kept = math.exp(-rate * period)
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
    relaxed *= 1.0 - math.exp(-rate * period)
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


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
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
    _add(columns, VISCOUS, p[VISCOUS], MASS, p[MASS], residual)
    _add(columns, REST_FORCE, p[REST_FORCE], TURN_FORCE, p[TURN_FORCE], residual)
    _add(columns, SLIP_FORCE, p[SLIP_FORCE], ORIGIN, p[ORIGIN], residual)
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
def _add(columns, i, by_i, j, by_j, total):  # type: ignore[no-untyped-def]
    """Add two columns times their unknowns."""
    a, b = columns[i], columns[j]
    for k in range(total.shape[0]):
        total[k] += by_i * a[k] + by_j * b[k]
