"""One move as two bounded least-squares problems with an arrival cost.

First zone A alone: it is linear in Coulomb force, viscous coefficient and mass, so one step solves
it. Then all that is usable, from onset to rest, from zone A's solution and with the same arrival
cost: each sample counts once. Unknown besides the figures: offsets of the friction force at rest
before the move and behind the last turn (what a position and a measured force there leave open), on
request at the beginning of zone A, and the level at knots joined by its Gauss-Markov process.

What can be solved: `prepare`; residual and derivatives: `residual`; weights and normal equations:
`whitening`; steps in a box: `estimation.least_squares`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from estimation.least_squares import cholesky_inverse, gauss_newton_into, quadratic_form
from estimation.online.belief.arrival_cost import joint_prior, take_over
from estimation.online.belief.belief import (
    ALPHA,
    COULOMB,
    KNOTS,
    LAG,
    LEVEL,
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
from estimation.online.solver.onset import first_stiffness
from estimation.online.solver.prepare import Prepared
from estimation.online.solver.residual import AtRest, fill_rows, make_rows
from estimation.online.solver.shared_rounding import share_rounding
from estimation.online.solver.whitening import (
    factor_weights,
    make_weights,
    normal_equations,
    unwhiten,
    weigh_apart,
    whiten,
)
from estimation.online.solver.zones import REST, SLIDE
from stagedata import F64
from stagedata.compiled import kernel

LEVEL_BOUND = 0.6
"""Largest level at a knot, either way."""
FREE_SLIP = 0.3
"""Spread of the friction force where zone A begins [Coulomb force], in a solve of zone A alone, and
at least behind an onset that was not seen."""
REST_COUNTS = 16.0
"""Largest ratio of force noise to the force that position noise makes in the sticking elements, at
which samples at rest count: they show where the motion began, and without them the scatter of
sigma0 is 1.4 times as large."""
MAX_ITERATIONS, HALVINGS, TOLERANCE, REMAINS = 20, 10, 1e-3, 0.03
"""Limits of Gauss-Newton: iterations; halvings of a step. It ends after a step of less than
TOLERANCE posterior standard deviations, or one that ends within REMAINS of them of the minimum."""

SOLVED, FAILED = range(2)

BLOCK = 10
"""Samples per sum in `_slow_residual`; also the number over which what the model misses beyond its
usual error is taken to be the same."""
LEFT_OPEN = 1.0
"""Uncertainty of the elements' forces at rest and after turns, as these have been followed without
the unmodelled force, over the rms of that force."""


class Solution(NamedTuple):
    """What a solve came to, besides the belief that it wrote.

    Attributes:
        status: SOLVED or FAILED.
        bound: figure that ended on its bound, or -1.
        chi: mean square of the whitened residual.
        unmodelled: what the move shows of the unmodelled force, see `_show_process`.
        wander: the same of the level.
        slow: mean square of the sums of whitened residuals over BLOCK samples, per sample: as
            `chi` where they are independent, more where neighbours are correlated.
        under_usual: the larger of `chi` and `slow`, with weights for the usual model error only.
    """

    status: int
    bound: int
    chi: float
    slow: float
    under_usual: float
    unmodelled: tuple[float, float]
    wander: tuple[float, float]


class Problem(NamedTuple):
    """A move to be solved.

    Attributes:
        axis: settings.
        law: constants of the friction law.
        prepared: the move.
        rest: friction state before it.
        step: resolution of the force, for `share_rounding` [N]; 0: not applied.
        time: of the move, in correlation times of level and unmodelled force.
        place: its way, in correlation lengths.
        share: of both together at each sample, 0 to 1, shape (K,).
        knots: of level and unmodelled force each.
    """

    axis: Any
    law: Any
    prepared: Prepared
    rest: AtRest
    step: float
    time: float
    place: float
    share: F64
    knots: int


@kernel()
def model_variance(axis, coulomb):  # type: ignore[no-untyped-def]
    """Variance of a row's force for what the model misses [N^2]; `coulomb` [N].

    More than the usual error comes from what the model does not have, and is no noise: BLOCK
    samples of it count as one.
    """
    usual = axis.usual_error**2
    return coulomb**2 * (usual + BLOCK * max(axis.model_error**2 - usual, 0.0))


@kernel()
def solve(problem, whole, linear, mask, before, p, after):  # type: ignore[no-untyped-def]
    """Gauss-Newton over figures, offsets and level (a long loop and what it starts from).

    Args:
        problem: the move.
        whole: all that is usable, else zone A alone.
        linear: one step as if the encoder were exact, for the next solve to begin at; no belief.
        mask: figures to solve for, shape (LEVEL,).
        before: belief before the move.
        p: first iterate by unknown, shape (KNOTS + knots + forces,); becomes the solution.
        after: belief after the move, written.
    """
    axis, law = problem.axis, problem.law
    knots = problem.knots if axis.wander > 0.0 else 0
    forces = problem.knots if axis.unmodelled > 0.0 else 0
    white = axis.force_noise**2 + model_variance(axis, axis.unit[COULOMB] * before.mean[COULOMB])
    use, start, end, counted = _choose_rows(
        whole, _rest_counts(p, axis, white), problem.prepared.samples, problem.prepared.end
    )
    if whole and mask[STIFFNESS]:
        p[STIFFNESS] = first_stiffness(
            p, axis, law, problem.prepared.samples, problem.rest, use,
            problem.prepared.slide > 0, before,
        )  # fmt: skip
    for i in range(LEVEL):
        if not mask[i]:
            p[i] = before.mean[i]
    chosen, figures = _choose_unknowns(whole, use[0], mask, knots, forces)
    n = chosen.shape[0] - 1
    unknowns = chosen[:n]
    prior, information = joint_prior(
        before, unknowns, figures, knots, forces, problem.time, problem.place, axis
    )
    lower, upper = _bounds(unknowns, knots, axis)
    value, move, away = np.empty(n), np.zeros(n), np.empty(n)
    for a in range(n):
        p[unknowns[a]] = value[a] = min(max(p[unknowns[a]], lower[a]), upper[a])
    wide = mask[RATE] or mask[ALPHA] or mask[LAG]
    rows, weights = make_rows(knots, forces, problem.share, end), make_weights(end)
    normal, trial = np.empty((n + 1, n + 1)), np.empty((n + 1, n + 1))
    cost, evaluations, halvings, done, status = math.inf, 0, 0, False, SOLVED
    while not done:
        doubts = fill_rows(
            p, axis, law, problem.prepared.samples, problem.rest, 0 if whole else start, wide, rows
        )
        if evaluations == 0:  # the weights stay what they are at the first iterate
            _weigh(p, problem, linear, rows, white, use[:end], weights)
            fresh = _fresh_slip(whole, problem.prepared.onset_seen, p)
            _open_offsets(fresh, use[0], p, axis, white, doubts, unknowns, information)
        if not linear:
            whiten(rows.columns, chosen, weights)
        normal_equations(rows.columns, chosen, weights, trial)
        evaluations += 1
        for a in range(n):
            away[a] = p[unknowns[a]] - prior[a]
        trial_cost = trial[n, n] + quadratic_form(information, away)
        if trial_cost <= cost * (1.0 + 1e-12):
            cost, halvings = trial_cost, 0
            for a in range(n + 1):
                for b in range(n + 1):
                    normal[a, b] = trial[a, b]
            for a in range(n):
                value[a] = p[unknowns[a]]
            length = gauss_newton_into(
                normal, normal[n, :n], information, prior, value, lower, upper, move
            )
            left = _left_behind(move, value, figures, knots, normal, information)
            if not math.isfinite(length):
                status, done = FAILED, True
            # The last step is taken, but not evaluated once more.
            elif length < TOLERANCE or left < REMAINS**2 or linear or evaluations > MAX_ITERATIONS:
                done = True
                normal[n, n] += quadratic_form(normal, move)
                for a in range(n):
                    normal[n, n] += 2.0 * move[a] * normal[a, n]
                    value[a] = min(max(value[a] + move[a], lower[a]), upper[a])
        elif evaluations == 1:  # not finite
            status, done = FAILED, True
        else:
            halvings += 1
            done = halvings == HALVINGS
            for a in range(n):
                move[a] *= 0.5
        for a in range(n):
            beyond = 0.0 if done else move[a]
            p[unknowns[a]] = min(max(value[a] + beyond, lower[a]), upper[a])
    bound = -1
    for a in range(figures):
        if status == SOLVED and (value[a] <= lower[a] or value[a] >= upper[a]):
            bound = unknowns[a]
    chi = normal[n, n] / max(counted, 1) if status == SOLVED else 0.0
    slow, under_usual, unmodelled, wander = 0.0, 0.0, (0.0, 0.0), (0.0, 0.0)
    if status == SOLVED and (not linear or bound >= 0):
        for a in range(n):
            for b in range(n):
                information[a, b] += normal[a, b]
        if cholesky_inverse(information):
            take_over(p, information, unknowns, figures, knots, forces, before, after)
            left = rows.columns[RESIDUAL]
            _step(rows.columns, unknowns, move, left)
            slow = _slow_residual(left, weights) / max(counted, 1)
            under_usual = max(chi, slow)
            if axis.model_error > axis.usual_error and not linear:
                unwhiten(left, weights)
                usual = axis.usual_error * axis.unit[COULOMB] * before.mean[COULOMB]
                white = axis.force_noise**2 + usual * usual
                _weigh(p, problem, linear, rows, white, use[:end], weights)
                under_usual = _weighed_square(left, weights) / max(counted, 1)
            wander = _show_process(value, information, figures, knots, axis.wander)
            unmodelled = _show_process(value, information, figures + knots, forces, axis.unmodelled)
        else:
            status = FAILED
    return Solution(status, bound, chi, slow, under_usual, unmodelled, wander)


@kernel()
def _show_process(value, covariance, first, knots, rms):  # type: ignore[no-untyped-def]
    """What a move shows of a Gauss-Markov process: mean square found, and share of it known.

    The share: 1 less the variance left over that of the process; 0 where the move says nothing.

    Args:
        value: of all unknowns, shape (n,).
        covariance: of them, shape (n, n).
        first: place of the process' first knot among them.
        knots: number of its knots, may be 0.
        rms: of the process.
    """
    square = left = 0.0
    for a in range(first, first + knots):
        square += value[a] ** 2 / knots
        left += covariance[a, a] / knots
    if knots == 0 or rms <= 0.0:
        return 0.0, 0.0
    return square, max(1.0 - left / rms**2, 0.0)


@kernel(fastmath={"contract"})
def _step(columns, unknowns, move, residual):  # type: ignore[no-untyped-def]
    """Carry a whitened residual, shape (K,), over the last step, in place.

    Args:
        columns: whitened, of the last pass, shape (*, K).
        unknowns: columns of the unknowns, shape (n,).
        move: the step from there, shape (n,).
        residual: of that pass.
    """
    for a in range(unknowns.shape[0]):
        column, by = columns[unknowns[a]], move[a]
        for k in range(residual.shape[0]):
            residual[k] += by * column[k]


@kernel(fastmath={"contract"})
def _slow_residual(left, weights):  # type: ignore[no-untyped-def]
    """Sum of squares of a whitened residual's sums over BLOCK samples; `left`: shape (K,)."""
    total = part = 0.0
    number = 0
    for k in range(left.shape[0]):
        if weights.inverse[k] > 0.0:
            part += left[k] * math.sqrt(weights.inverse[k])
            number += 1
            if number == BLOCK:
                total += part * part
                part, number = 0.0, 0
    return total + part * part


@kernel()
def _weighed_square(residual, weights):  # type: ignore[no-untyped-def]
    """Sum of squares of a residual, shape (K,), or of its sums over BLOCK samples if that is more.

    Whitened in place.
    """
    whiten(residual.reshape((1, residual.shape[0])), np.zeros(1, np.int64), weights)
    single = 0.0
    for k in range(residual.shape[0]):
        single += weights.inverse[k] * residual[k] ** 2
    return max(single, _slow_residual(residual, weights))


@kernel()
def _rest_counts(p, axis, white):  # type: ignore[no-untyped-def]
    """Whether samples at rest count one by one; `white`: variance of a row's force [N^2].

    `p`: unknowns by column, shape (KNOTS + knots + forces,).

    The force at rest is already known from the mean of those samples, so they are left out, unless
    the force is exact enough for single samples to show the errors of the positions.
    """
    pull = axis.unit[STIFFNESS] * p[STIFFNESS] * axis.position_noise
    return axis.force_noise < pull or white < (REST_COUNTS * pull) ** 2


@kernel()
def _choose_rows(whole, rest_counts, samples, last):  # type: ignore[no-untyped-def]
    """Which rows count, shape (K,); the first one, where the rows may end, how many count."""
    zone, count = samples.zone, samples.zone.shape[0]
    begin, end = 0, last if whole else count
    while whole and begin < end and not rest_counts and zone[begin] == REST:
        begin += 1
    use = np.zeros(count, np.bool_)
    counted, start = 0, end
    for k in range(begin, end):
        use[k] = samples.usable[k] and (whole or zone[k] == SLIDE)
        counted += use[k]
        if use[k] and k < start:
            start = k
    while not whole and end > 0 and not use[end - 1]:
        end -= 1
    return use, start, end, counted


@kernel()
def _choose_unknowns(whole, from_rest, mask, knots, forces):  # type: ignore[no-untyped-def]
    """Columns of the unknowns and, last, of the residual; how many of them are figures.

    Zone A does not rely on how it began: the friction force at its start is an unknown, which takes
    up all that was unknown before. The first position's error acts as a force on all that sticks,
    and differently in the first row; where that row does not count, the force at rest includes it.
    """
    figures = 0
    for i in range(LEVEL):
        figures += mask[i]
    offsets = 1 if not whole else 4 if from_rest else 3
    knots += forces
    chosen = np.empty(figures + knots + offsets + 1, np.int64)
    a = 0
    for i in range(LEVEL):
        if mask[i]:
            chosen[a] = i
            a += 1
    for j in range(knots):
        chosen[figures + j] = KNOTS + j
    for j in range(offsets):
        chosen[figures + knots + j] = REST_FORCE + j if whole else SLIP_FORCE
    chosen[-1] = RESIDUAL
    return chosen, figures


@kernel()
def _bounds(unknowns, knots, axis):  # type: ignore[no-untyped-def]
    """Lowest and highest values, shapes (n,), of the unknowns with these columns, shape (n,)."""
    n = unknowns.shape[0]
    lower, upper = np.empty(n), np.empty(n)
    for a in range(n):
        lower[a], upper[a] = -1e300, 1e300
        if unknowns[a] < LEVEL:
            lower[a], upper[a] = axis.lower[unknowns[a]], axis.upper[unknowns[a]]
        elif KNOTS <= unknowns[a] < KNOTS + knots:
            lower[a], upper[a] = -LEVEL_BOUND, LEVEL_BOUND
    return lower, upper


@kernel()
def _weigh(p, problem, linear, rows, white, use, weights):  # type: ignore[no-untyped-def]
    """Weights of the rows, of which `use`, shape (K,), count, at the unknowns `p` (7 arguments).

    `white`: variance of each [N^2]; `linear`: as if the encoder were exact.
    """
    axis, force, step = problem.axis, problem.prepared.samples.force, problem.step
    variance = np.empty(use.shape[0])
    for k in range(use.shape[0]):
        variance[k] = rows.variance[k] + white
    mass = axis.unit[MASS] * p[MASS]
    if linear:
        weigh_apart(variance, use, weights)
        return
    if step > 0.0:
        jitter = mass * axis.position_noise / axis.period**2
        share_rounding(force, rows.columns[RESIDUAL], use, step, jitter, variance)
    factor_weights(
        mass, axis.unit[VISCOUS] * p[VISCOUS], axis.period, axis.position_noise, rows.spring,
        variance, use, weights,
    )  # fmt: skip


@kernel()
def _fresh_slip(whole, onset_seen, p):  # type: ignore[no-untyped-def]
    """Spread of the friction force where zone A begins, beside what positions leave open [Fc].

    Behind an onset that was not seen the force is anywhere up to the static one.
    """
    if whole:
        return 0.0 if onset_seen else max(FREE_SLIP, p[ALPHA])
    return FREE_SLIP


@kernel()
def _open_offsets(fresh, from_rest, p, axis, white, doubts, unknowns, information):  # type: ignore[no-untyped-def]
    """Add the priors of what is neither figure nor knot to `information`, shape (n, n); mean 0.

    `fresh`: of `_fresh_slip`; `doubts`: of the friction force behind the last turn, and where zone
    A begins [N].
    """
    pull = axis.unit[STIFFNESS] * p[STIFFNESS] * axis.position_noise
    slip = fresh * axis.unit[COULOMB] * p[COULOMB]
    white += (LEFT_OPEN * axis.unit[COULOMB] * axis.unmodelled) ** 2
    for a in range(unknowns.shape[0]):
        variance = 0.0
        if unknowns[a] == REST_FORCE:
            variance = white if from_rest else white + pull * pull
        elif unknowns[a] == TURN_FORCE:
            variance = white + pull * pull + doubts[0] * doubts[0]
        elif unknowns[a] == SLIP_FORCE:
            variance = slip * slip + doubts[1] * doubts[1] + 1e-20
        elif unknowns[a] == ORIGIN:
            variance = 1.0
        if variance > 0.0:
            information[a, a] = 1.0 / variance


@kernel()
def _left_behind(move, value, figures, knots, normal, information):  # type: ignore[no-untyped-def]
    """Estimate how far from the minimum a step ends, in squared posterior standard deviations.

    The residual contains products of figures, and of figures and level, so a step misses by about
    its own square; offsets are linear. `move`, `value`: shape (n,); `normal`, `information`: (>= n,
    >= n).
    """
    n = move.shape[0]
    away, largest = np.zeros(n), 0.0
    for a in range(figures):
        share = move[a] / max(abs(value[a]), 0.5)
        largest = max(largest, abs(share))
        away[a] = move[a] * share
    for a in range(figures, figures + knots):
        away[a] = move[a] * largest
    return quadratic_form(normal, away) + quadratic_form(information, away)
