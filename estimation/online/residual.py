"""Residual of a move and its derivatives by every unknown, sample by sample, in one pass.

The model is driven by the measured positions, segment by segment (`zones.find_turns`): inside a
segment the direction is known, an element that slips goes on slipping until the motion turns, and
one that sticks stretches with the position. So nothing is decided by noise, and no dead band is
needed. What a position's error does to a sample follows: through the second difference, through
viscous friction, and through the elements that stick (`T_STUCK`).

Written column by column, (columns, samples): whitening and normal equations then run along
contiguous memory. Where all elements stick, or all slip, samples are taken at once (`stretches`);
here is what lies between, and what a row has besides the elements.
"""

from __future__ import annotations

import math

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
    SLIPS,
    begin,
    step_elements,
    stribeck_rise,
    sum_elements,
)
from estimation.friction.gms import NO_SUBSTEPS
from estimation.online.belief import ALPHA, COULOMB, LAG, MASS, RATE, STIFFNESS, VISCOUS
from estimation.online.move_tables import (
    CURVED,
    KNOTS,
    ORIGIN,
    RESIDUAL,
    REST_FORCE,
    SLIP_FORCE,
    SUBSTEPS,
    T_ACCELERATION,
    T_AT,
    T_CURVE,
    T_FORCE,
    T_HAZE,
    T_LEVEL,
    T_POSITION,
    T_SCALE,
    T_SHARE,
    T_SHARP,
    T_SLOPE,
    T_STUCK,
    T_VELOCITY,
    TURN_FORCE,
)
from estimation.online.slip_transition import follow_curve, rise_before
from estimation.online.stretches import slip, slip_haze, spring

UNSEEN = 0.5
"""A motion that comes to a stop without turning visibly creeps on below the noise for so many
samples; elements that slip gain meanwhile."""


@kernel()
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
        wide, weigh, knots >= 0, columns, elements,
    )  # fmt: skip
    pull = -figures[STIFFNESS] * p[STIFFNESS] * noise
    _finish(p, knots, figures, pull, noise / period, period, tables, wide, columns)
    return doubts


@kernel()
def fill_slide(  # type: ignore[no-untyped-def]
    p, knots, figures, shape, period, start, tables, heading, ready, wide, columns, elements
):
    """Rows of zone A alone: all elements slip, from one force on that is as after a fresh slip.

    `start` is the first row of zone A; what comes before it is nought, what follows has to be one
    stretch. The other arguments: as `fill_rows`.
    """
    n = elements.shape[1] - 1
    direction, coulomb = float(heading[start]), figures[COULOMB] * p[COULOMB]
    for column in (COULOMB, STIFFNESS, REST_FORCE, TURN_FORCE, SLIP_FORCE, RESIDUAL):
        for k in range(start):
            columns[column, k] = 0.0
    for k in range(start):
        tables[T_STUCK, k] = tables[T_HAZE, k] = tables[T_LEVEL, k] = 0.0
    for row in range(SLIPS):
        for i in range(n + 1):
            elements[row, i] = 0.0
    for i in range(n):
        share = elements[SHARES, i]
        elements[FORCE, i] = direction * share * coulomb
        elements[BY_COULOMB, i], elements[BY_SLIP, i] = direction * share, share
        elements[SLIPS, i] = 1.0
    elements[SHARES, n] = -1.0
    sum_elements(elements)
    rate, alpha = figures[RATE] * p[RATE], p[ALPHA]
    kept = math.exp(-rate * period)
    slip(
        start, direction, kept, coulomb, rate, alpha, shape, period, wide, knots >= 0, tables,
        ready, columns, elements,
    )  # fmt: skip
    for k in range(columns.shape[1]):
        tables[T_STUCK, k] = tables[T_HAZE, k] = 0.0
    _finish(p, knots, figures, 0.0, 0.0, period, tables, wide, columns)


@kernel()
def lead(  # type: ignore[no-untyped-def]
    p, figures, shape, noise, period, start, known_coulomb, rest_force, tables, heading, ready,
    wide, weigh, record, columns, elements,
):  # fmt: skip
    """Lead the elements through a move; of each row the sum of their forces and its derivatives.

    Arguments and what it returns: as `fill_rows`; `record` is whether the rows are wanted at all.
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
            reached = spring(
                k, direction, coulomb, stiffness, alpha, level_at, wide, record, tables, columns,
                elements,
            )  # fmt: skip
            if reached > k:
                k = reached
                continue
        elif stuck == 0 and turn < 0.0:
            reached = slip(
                k, direction, kept, coulomb, rate, alpha, shape, period, wide, record, tables,
                ready, columns, elements,
            )  # fmt: skip
            if weigh:
                follows = (1.0 - kept) * error_by_slope
                haze = slip_haze(k, reached, haze, kept, follows, tables, ready)
            k, level_at = reached, reached - 1
            continue
        stuck, relaxed, haze = lead_sample(
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


@kernel(forceinline=True)
def lead_sample(  # type: ignore[no-untyped-def]
    k, haze, kept, error_by_slope, coulomb, stiffness, rate, alpha, shape, noise, period,
    tables, heading, ready, elements,
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
        elements[SHARES, n] = rise_before(k, vs, delta, period, tables)
    if turn < 0.0:
        landed = slack = 0.0
        slow = min(v0 * heading_now, v1 * heading_now) <= NO_SUBSTEPS * vs
        steps = SUBSTEPS if slow else 1
        dt = period / steps
        shift = (x1 - x0) / period - 0.5 * (v0 + v1)
        if not ready[k] & CURVED:
            follow_curve(k, heading_now, rate, alpha, shape, period, tables, ready)
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
    sharp = tables[T_SHARP, k]
    dt = (turn if sharp > 0.0 else turn + UNSEEN) * period / SUBSTEPS
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


@kernel(fastmath={"contract"}, forceinline=True)
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
    if p[REST_FORCE] != 0.0 or p[TURN_FORCE] != 0.0:
        _add(columns[REST_FORCE], p[REST_FORCE], columns[TURN_FORCE], p[TURN_FORCE], residual)
    if p[SLIP_FORCE] != 0.0 or p[ORIGIN] != 0.0:
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


@kernel()
def _scale(row, factor, out):  # type: ignore[no-untyped-def]
    """A row in other units; few rows at a time are what a compiler sees through."""
    for k in range(min(row.shape[0], out.shape[0])):
        out[k] = factor * row[k]


@kernel(fastmath={"contract"})
def _add(a, by_a, b, by_b, total):  # type: ignore[no-untyped-def]
    """Add two columns times their unknowns."""
    for k in range(total.shape[0]):
        total[k] += by_a * a[k] + by_b * b[k]
