"""Residual of a move and its derivatives by every unknown, sample by sample, in one pass.

The friction law is driven by the measured positions. Between two turns of the motion the direction
is known, whatever noise does to the velocity, so no dead band is needed. An error of a position
acts on a row through the second difference, through viscous friction, and through the elements
that stick (`Rows.spring`).

Columns are contiguous, shape (columns, samples): whitening and normal equations run along them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.friction.law import (
    BY_ALPHA,
    BY_COULOMB,
    BY_RATE,
    BY_REST,
    BY_SLIP,
    BY_STIFFNESS,
    BY_TURN,
    FAR_ABOVE,
    FORCE,
    NO_SUBSTEPS,
    Figures,
    begin,
    begin_zone,
    finish,
    leap,
    make_trace,
    release,
    retained,
    slide,
    step,
    stribeck_rise,
)
from estimation.online.belief.belief import (
    ALPHA,
    COULOMB,
    KNOTS,
    LAG,
    MASS,
    ORIGIN,
    RATE,
    RESIDUAL,
    REST_FORCE,
    SLIP_FORCE,
    STIFFNESS,
    TURN_FORCE,
    VISCOUS,
)
from stagedata import F64
from stagedata.compiled import kernel

SUBSTEPS = 4
"""Steps of the friction law per sample period, up to `NO_SUBSTEPS` Stribeck velocities."""
UNSEEN = 0.5
"""A motion that stops without a visible reversal is taken to creep on, below the noise, for this
many samples; the force of slipping elements rises in that time."""


class AtRest(NamedTuple):
    """Friction state at rest before a move.

    Attributes:
        forces: internal forces of the law [N], shape (n,).
        known: Coulomb force under which they are known [N].
        total: force measured there [N].
    """

    forces: F64
    known: float
    total: float


class Rows(NamedTuple):
    """Residual of a move's inner samples, and what its noise depends on.

    Attributes:
        columns: derivatives by the unknowns in their units, and the residual, predicted minus
            measured [N], in column RESIDUAL, shape (KNOTS + knots + forces, K).
        spring: stiffness of what sticks at each sample [N/m], shape (K,).
        variance: of the force of sliding elements, due to position errors [N^2], shape (K,).
        level_at: for each sample, the latest one with a sliding element (level acts), shape (K,).
        forces: number of knots of the unmodelled force, in the last columns.
        share: fraction of the path covered at each sample, shape (K,); unused if `forces` is 0.
    """

    columns: F64
    spring: F64
    variance: F64
    level_at: F64
    forces: int
    share: F64


class Interval(NamedTuple):
    """One sample period of a motion.

    Attributes:
        travel: within it [m].
        v0, v1: speeds at its ends [m/s].
        direction: of motion, +1 or -1.
        rise: Stribeck rise at the end of the last step before it.
    """

    travel: float
    v0: float
    v1: float
    direction: float
    rise: float


class Turn(NamedTuple):
    """Where the motion turns or stops within a sample period.

    Attributes:
        share: of the period.
        travel: up to there [m].
        sharpness: curvature [m per squared sample], 0 for a stop.
        direction: of motion up to there.
    """

    share: float
    travel: float
    sharpness: float
    direction: float


@kernel()
def make_rows(knots, forces, share, count):  # type: ignore[no-untyped-def]
    """Workspace for `knots` knots of the level, and the rest as in `Rows`; `count` samples."""
    return Rows(
        np.empty((KNOTS + knots + forces, count)), np.empty(count), np.empty(count),
        np.empty(count), forces, share,
    )  # fmt: skip


@kernel()
def figures_at(p, axis, law):  # type: ignore[no-untyped-def]
    """Friction figures in their units, of unknowns `p` that begin with the relative ones."""
    rate = axis.unit[RATE] * p[RATE]
    return Figures(
        axis.unit[COULOMB] * p[COULOMB], axis.unit[STIFFNESS] * p[STIFFNESS], rate, p[ALPHA],
        axis.period, retained(law, rate, axis.period),
    )  # fmt: skip


@kernel()
def fill_rows(p, axis, law, samples, rest, start, wide, rows):  # type: ignore[no-untyped-def]
    """Write the rows of a move.

    Args:
        p: unknowns, by column, shape (KNOTS + knots + forces,).
        axis: settings.
        law: constants of the friction law.
        samples: prepared.
        rest: friction state before the move.
        start: first sample; 0 starts from rest. Otherwise only zone A, from this sample on, all
            elements sliding as after long travel; earlier rows are 0.
        wide: whether the derivatives by C/Fc, alpha and lag are wanted.
        rows: written.

    Returns:
        Uncertainty of the friction force after the last turn and at the start of zone A [N], apart
        from that due to the error of the first position.
    """
    traces, figures = make_trace(law), figures_at(p, axis, law)
    if start > 0:
        for k in range(start):
            for i in range(KNOTS):
                rows.columns[i, k] = 0.0
            rows.spring[k] = rows.variance[k] = rows.level_at[k] = 0.0
        slide(law, figures, traces[0], float(samples.heading[start]))
    else:
        total = rest.total  # includes the unmodelled force, which is not friction
        if rows.forces > 0:
            total -= axis.unit[COULOMB] * p[p.shape[0] - rows.forces]
        begin(law, figures, traces[0], rest.forces, rest.known, total)
    doubts = _trace(figures, axis, law, samples, start, rows.spring.shape[0], traces, True, rows)
    _complete(p, axis, samples, start, wide, rows)
    return doubts


@kernel()
def follow_move(p, axis, law, samples, rest, forces, slips):  # type: ignore[no-untyped-def]
    """Friction state at the end of a move: internal forces [N] and which slide, shapes (n,).

    The other arguments: as `fill_rows`; `rest.forces` may be `forces`.
    """
    traces, figures = make_trace(law), figures_at(p, axis, law)
    begin(law, figures, traces[0], rest.forces, rest.known, rest.total)
    count = samples.velocity.shape[0]
    nothing = np.empty(0)
    _trace(figures, axis, law, samples, 0, count, traces, False, make_rows(0, 0, nothing, 0))
    finish(law, traces[0], forces, slips)


@kernel()
def _trace(figures, axis, law, samples, start, end, traces, record, rows):  # type: ignore[no-untyped-def]
    """Drive the friction law along samples start..end-1 (9 arguments: two callers, one pass).

    Each sample is reached from the one before by `leap` where the law can take the whole period at
    once, by `_turn` where the motion turns or stops within it, else by `_advance`. With `record`,
    the law's force, its derivatives and what its noise depends on are written to `rows`; the other
    parts of the residual follow in `_complete`. Returns what `fill_rows` returns.

    `traces`: of the law, begun.
    """
    trace = traces[0]
    # Local names: inside the loop, reading an array from a tuple changes its reference count twice.
    position, velocity, heading = samples.position, samples.velocity, samples.heading
    turn_share, turn_at, sharpness = samples.turn_share, samples.turn_at, samples.turn_sharpness
    columns, spring, variances, levels = rows.columns, rows.spring, rows.variance, rows.level_at
    noise, vs = axis.position_noise, law.stribeck_velocity
    fast = vs * FAR_ABOVE ** (1.0 / law.stribeck_shape)
    # Force error due to velocity noise, per unit slope of the Stribeck curve over v/vs [N].
    by_slope = figures.alpha * figures.coulomb * noise * math.sqrt(0.5) / (axis.period * vs)
    variance = turn_doubt = zone_doubt = 0.0
    level_at, in_zone = start, start > 0
    for k in range(start, end):
        v1 = velocity[k]
        v0 = velocity[k - 1] if k > 0 else v1
        direction, travel, turned = float(heading[k]), position[k + 1] - position[k], 0.0
        slowest = min(v0 * direction, v1 * direction)
        if turn_share[k] < 0.0 and leap(law, figures, trace, travel, direction, slowest > fast):
            if trace.sliding > 0.0:
                variance *= figures.retained**2
        else:
            earlier = velocity[k - 2] if k > 1 else v0
            moved = position[k] - position[k - 1] if k > 0 else v0 * axis.period
            rise = _rise_before(law, axis.period, moved, v0, earlier)
            interval = Interval(travel, v0, v1, direction, rise)
            if turn_share[k] < 0.0:
                variance = _advance(law, figures, trace, interval, noise, by_slope, variance)
            else:
                back = k > 0 and heading[k - 1] == -heading[k]
                turn = Turn(
                    turn_share[k], turn_at[k] - position[k], sharpness[k],
                    -direction if back else direction,
                )  # fmt: skip
                turned = _turn(law, figures, trace, interval, turn, noise)
                if turned > 0.0:
                    turn_doubt = max(turn_doubt, math.sqrt(turned * turned + variance))
                    variance = 0.0
        if trace.sliding == 1.0 and not in_zone:
            in_zone, zone_doubt, variance = True, math.sqrt(variance), 0.0
            begin_zone(law, trace)
        if trace.sliding > 0.0:
            level_at = k
        if record:
            total = trace.total
            columns[RESIDUAL, k] = total[FORCE]
            columns[COULOMB, k] = total[BY_COULOMB]
            columns[STIFFNESS, k] = total[BY_STIFFNESS]
            columns[REST_FORCE, k] = total[BY_REST]
            columns[TURN_FORCE, k] = total[BY_TURN]
            columns[SLIP_FORCE, k] = total[BY_SLIP]
            columns[RATE, k] = total[BY_RATE]
            columns[ALPHA, k] = total[BY_ALPHA]
            spring[k], levels[k] = trace.spring, level_at
            variances[k] = (variance if trace.sliding > 0.0 else 0.0) + turned * turned
    return turn_doubt, zone_doubt


@kernel()
def _rise_before(law, period, moved, v1, v0):  # type: ignore[no-untyped-def]
    """Stribeck rise in a period's last step, 0..1; `moved` [m] in it, speeds at its ends [m/s]."""
    vs = law.stribeck_velocity
    steps = SUBSTEPS if min(abs(v0), abs(v1)) <= NO_SUBSTEPS * vs else 1
    v = moved / period + (v1 - v0) * (steps - 1) / (2 * steps)
    return stribeck_rise(abs(v) / vs, law.stribeck_shape)


@kernel()
def _advance(law, figures, trace, interval, noise, by_slope, variance):  # type: ignore[no-untyped-def]
    """One period in one direction, in substeps.

    `noise`: rms of the position noise [m]; `by_slope`: force error due to velocity noise, per unit
    slope of the Stribeck curve [N]; `variance`: of the force, due to position errors, before the
    period [N^2]. Returns that variance after the period.
    """
    vs, shape, period = law.stribeck_velocity, law.stribeck_shape, figures.period
    v0, v1, direction, before = interval.v0, interval.v1, interval.direction, interval.rise
    steps = SUBSTEPS if min(v0 * direction, v1 * direction) <= NO_SUBSTEPS * vs else 1
    shift = interval.travel / period - 0.5 * (v0 + v1)
    landed = slack = 0.0
    for j in range(steps):
        v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
        rise = stribeck_rise(abs(v) / vs, shape)
        some, loose = step(
            law, figures, trace, v * period / steps, direction, before, rise, period / steps
        )
        before = rise
        landed += some
        slack += loose
    # Elements that begin to slide take on the curve's error at once; sliding ones follow slowly.
    ratio = abs(v1) / vs
    slope = shape * stribeck_rise(ratio, shape)
    error = by_slope * (slope if shape == 1.0 else slope * ratio ** (shape - 1.0))
    slid = (1.0 - figures.retained) * trace.sliding
    variance = variance * figures.retained**2 + (landed * landed + slid * slid) * error * error
    return variance + (slack * noise) ** 2


@kernel()
def _turn(law, figures, trace, interval, turn, noise):  # type: ignore[no-untyped-def]
    """One period in which the motion turns or stops, in substeps up to the turn and one step after.

    At the turn all elements stick. Returns by how much the friction force is uncertain afterwards
    [N], because position noise hides when within the period the motion turned.

    `noise`: rms of a position [m].
    """
    vs, shape, period = law.stribeck_velocity, law.stribeck_shape, figures.period
    time = (turn.share if turn.sharpness > 0.0 else turn.share + UNSEEN) * period / SUBSTEPS
    before = interval.rise
    for j in range(SUBSTEPS if turn.share > 0.0 else 0):
        left = 1.0 - (j + 0.5) / SUBSTEPS  # the velocity falls to zero
        rise = stribeck_rise(abs(interval.v0) * left / vs, shape)
        travel = turn.travel * 2.0 * left / SUBSTEPS
        step(law, figures, trace, travel, turn.direction, before, rise, time)
        before = rise
    open_left = release(law, figures, trace, turn.direction) * (1.0 - figures.retained)
    open_left *= min(0.5, noise / turn.sharpness) if turn.sharpness > 0.0 else 0.5
    if turn.share < 1.0:
        rise = stribeck_rise(abs(0.5 * interval.v1) / vs, shape)
        time = (1.0 - turn.share) * period
        travel = interval.travel - turn.travel
        step(law, figures, trace, travel, -turn.direction, 1.0, rise, time)
    return open_left


@kernel(fastmath={"contract"})
def _complete(p, axis, samples, start, wide, rows):  # type: ignore[no-untyped-def]
    """Complete the rows that `_trace` has written: all parts but the law's force F.

        r = F + sigma_v v + m a + w Fc dF/dFc + d + offsets - (f + l f' + l^2 f''/2)

    with the level w and the unmodelled force d linear between their knots, the measured force f and
    its lag l [samples]. Arguments as `fill_rows`; columns become [N per unit of the unknown], shape
    (KNOTS + knots + forces, K).
    """
    columns, unit, force = rows.columns, axis.unit, samples.force
    count, knots = columns.shape[1], columns.shape[0] - KNOTS - rows.forces
    residual, velocity, acceleration = columns[RESIDUAL], samples.velocity, samples.acceleration
    level_at = rows.level_at
    # An error of the first position acts as a force on sticking elements and as a velocity error.
    pull = -unit[STIFFNESS] * p[STIFFNESS] * axis.position_noise if start == 0 else 0.0
    swing = axis.position_noise / axis.period if start == 0 else 0.0
    for k in range(count):
        columns[COULOMB, k] *= unit[COULOMB]
        columns[STIFFNESS, k] *= unit[STIFFNESS]
        columns[VISCOUS, k] = unit[VISCOUS] * velocity[k]
        columns[MASS, k] = unit[MASS] * acceleration[k]
        columns[ORIGIN, k] = pull * columns[REST_FORCE, k]
    # The first row has this error in its second difference too.
    columns[ORIGIN, 0] += swing * (
        unit[MASS] * p[MASS] / axis.period - 0.5 * unit[VISCOUS] * p[VISCOUS]
    )
    for i in (VISCOUS, MASS, REST_FORCE, TURN_FORCE, SLIP_FORCE, ORIGIN):
        if p[i] != 0.0:
            _add(p[i], columns[i], residual)
    for k in range(count):
        residual[k] -= force[k + 1]
    if wide:
        lag = p[LAG]
        for k in range(count):
            columns[RATE, k] *= unit[RATE]
            slope = 0.5 * (force[k + 2] - force[k])
            bend = force[k + 2] - 2.0 * force[k + 1] + force[k]
            residual[k] -= lag * (slope + 0.5 * lag * bend)
            columns[LAG, k] = -(slope + lag * bend)
    if knots > 0:
        for j in range(KNOTS, KNOTS + knots):
            for k in range(count):
                columns[j, k] = 0.0
        for k in range(count):
            place = rows.share[int(level_at[k])] * (knots - 1)
            knot = min(int(place), knots - 2)
            share, scale = place - knot, columns[COULOMB, k] * p[COULOMB]
            columns[KNOTS + knot, k] = scale * (1.0 - share)
            columns[KNOTS + knot + 1, k] = scale * share
            residual[k] += scale * (p[KNOTS + knot] * (1.0 - share) + p[KNOTS + knot + 1] * share)

    if rows.forces > 0:
        _add_unmodelled(p, axis, start, KNOTS + knots, rows)


@kernel(fastmath={"contract"})
def _add_unmodelled(p, axis, start, first, rows):  # type: ignore[no-untyped-def]
    """Write the columns of the unmodelled force, from `first` on, and add it to the residual.

    It is linear between knots along the path. At rest it is part of the measured force, which
    therefore leaves less for friction. `start` as in `fill_rows`.
    """
    columns, share, forces = rows.columns, rows.share, rows.forces
    unit, residual, rest = axis.unit[COULOMB], columns[RESIDUAL], columns[REST_FORCE]
    for j in range(first, first + forces):
        for k in range(residual.shape[0]):
            columns[j, k] = 0.0
    for k in range(residual.shape[0]):
        place = share[k] * (forces - 1)
        knot = min(int(place), max(forces - 2, 0))
        along = place - knot
        columns[first + knot, k] = unit * (1.0 - along)
        residual[k] += unit * (1.0 - along) * p[first + knot]
        if forces > 1:
            columns[first + knot + 1, k] = unit * along
            residual[k] += unit * along * p[first + knot + 1]
        if start == 0:
            columns[first, k] -= unit * rest[k]


@kernel(fastmath={"contract"})
def _add(factor, column, total):  # type: ignore[no-untyped-def]
    """Add a column, shape (K,), times its unknown to `total` [N], shape (K,)."""
    for k in range(total.shape[0]):
        total[k] += factor * column[k]
