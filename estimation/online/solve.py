"""One move as two bounded least-squares problems with an arrival cost, compiled as a whole.

First zone A alone: it is linear in Coulomb force, viscous coefficient and mass, so one pass solves
it. Then all that is usable, from onset to rest, from zone A's solution and with the same arrival
cost: each sample counts once. Unknown besides the figures: the elements' force at rest before the
move and behind the last turn (what a position and a measured force there leave open), on request
the one at the beginning of zone A, and the level at knots joined by its Gauss-Markov process.

What can be solved: `preparation`; residual and derivatives: `rows`; weights and normal equations:
`whitening`; steps in a box: `least_squares`.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel
from estimation.flat_room import as_rows
from estimation.least_squares import cholesky_inverse, gauss_newton_into, quadratic_form
from estimation.online.arrival_cost import believe, joint_prior
from estimation.online.belief import ALPHA, COULOMB, LAG, LEVEL, MASS, RATE, STIFFNESS, VISCOUS
from estimation.online.move_tables import (
    KNOTS,
    M_HEADING,
    M_READY,
    M_USABLE,
    M_USE,
    M_ZONE,
    MOST,
    OFFSETS,
    RESIDUAL,
    REST_FORCE,
    SLIP_FORCE,
    T_FORCE,
    T_HAZE,
    T_STUCK,
    T_UNTIL,
    TURN_FORCE,
)
from estimation.online.onset import first_stiffness
from estimation.online.residual import fill_rows, fill_slide
from estimation.online.shared_rounding import share_rounding
from estimation.online.update_tables import (
    C_FORCE_NOISE,
    C_MODEL_ERROR,
    C_PERIOD,
    C_POSITION_NOISE,
    C_SLIP_SPREAD,
    C_VS,
    F_LOWER,
    F_UNIT,
    F_UPPER,
    R_BOUND,
    R_CHI_A,
    R_CHI_B,
    R_CODES,
    R_END,
    R_EVALUATIONS,
    R_FAILED,
    R_KNOWN,
    R_REST_FORCE,
    R_SAMPLES,
    R_STICK,
)
from estimation.online.whitening import factor_weights, normal_equations, whiten
from estimation.online.zones import REST, SLIDE

LEVEL_BOUND = 0.2
FREE_SLIP = 0.3
"""Spread of the element forces where zone A begins, in a solve of zone A alone [Coulomb force]."""
TELLS = 16.0
"""Force noise, in what the encoder's does to a spring (at the figures before), up to which the
samples at rest tell where the motion began: without them sigma0 spreads 1.4 times as far."""
MAX_ITERATIONS, HALVINGS, TOLERANCE, REMAINS = 20, 10, 1e-3, 0.03
"""Of Gauss-Newton; a step below TOLERANCE posterior standard deviations ends it, and one that
leaves at most REMAINS of them to go."""


@kernel()
def fit(  # type: ignore[no-untyped-def]
    whole, tables, marks, constants, units, forces, prior_mean, prior_covariance, mean, covariance,
    mask, p, led, elements, room, spare, scratch, report,
):  # fmt: skip
    """Gauss-Newton over the free figures and what goes with them, in zone A or all that is usable.

    Args:
        whole: all that is usable, else zone A.
        tables: of `prepare`.
        marks: M_*, of `prepare`; M_READY of `rows.fill_rows`, M_USE written.
        constants: C_*.
        units: as there.
        forces: of the elements at rest before the move, under R_KNOWN [N], shape (N,).
        prior_mean: belief before the move.
        prior_covariance: of it.
        mean: belief after it, written.
        covariance: the same.
        mask: figures to solve for, shape (LEVEL,).
        p: first iterate, shape (KNOTS + knots,); becomes the solution.
        led: figures that the elements were last led through with, written, shape (LEVEL,).
        elements: of `rows.fill_rows`; left as at the last row.
        room: for the names of the columns, shape (>= MOST,).
        spare: for what belongs to them, shape (>= SPARE,).
        scratch: for rows and weights, shape (>= (KNOTS + knots + 4) K,).
        report: R_*. Chi-squares are means over their zones' samples; R_BOUND is a figure on its
            bound, or -1; R_FAILED is 1 where the problem has no solution.
    """
    heading, zone, usable = marks[M_HEADING], marks[M_ZONE], marks[M_USABLE]
    ready, use = marks[M_READY], marks[M_USE]
    count = tables.shape[1] - 2
    knots = p.shape[0] - KNOTS
    linear = not whole and report[R_STICK] > 0.0  # one step, for the second solve to begin at
    # Which rows count. The force at rest is known from the mean of the rest's samples: they count
    # once, but where the force is so exact that they tell the positions' errors.
    spread = constants[C_MODEL_ERROR] * units[F_UNIT, COULOMB] * prior_mean[COULOMB]
    white = constants[C_FORCE_NOISE] ** 2 + spread * spread
    pull = units[F_UNIT, STIFFNESS] * p[STIFFNESS] * constants[C_POSITION_NOISE]
    moves = constants[C_FORCE_NOISE] < pull or white < (TELLS * pull) ** 2
    start, end, counted = _choose(
        whole, moves, zone[:count], usable[:count], int(report[R_END]), use[:count]
    )
    if whole:
        first_stiffness(
            p, prior_mean, prior_covariance, zone[:count], tables, use, forces, constants, units,
            report,
        )  # fmt: skip
    figures = _count(mask)
    for i in range(LEVEL):
        if not mask[i]:
            p[i] = prior_mean[i]
    reshaped = mask[RATE] or mask[ALPHA]
    wide = reshaped or mask[LAG]
    first = figures + knots
    # Zone A does not rely on how it began: the force there is free, and what else was unknown
    # before makes no other difference. The first position's error is a force on all elements, but
    # in the first row; where that does not count, it goes with the force at rest.
    apart = whole and use[0]
    n = first + (1 if not whole else OFFSETS if apart else OFFSETS - 1)
    chosen = room[: n + 1]
    a = 0
    for i in range(LEVEL):
        if mask[i]:
            chosen[a] = i
            a += 1
    for j in range(knots):
        chosen[figures + j] = KNOTS + j
    for a in range(first, n):
        chosen[a] = REST_FORCE + (a - first) if whole else SLIP_FORCE
    chosen[n] = RESIDUAL
    prior, lower, upper = spare[:n], spare[n : 2 * n], spare[2 * n : 3 * n]
    value, away, step = spare[3 * n : 4 * n], spare[4 * n : 5 * n], spare[5 * n : 6 * n]
    begin, size = 6 * MOST, (n + 1) * (n + 1)
    information = as_rows(spare[begin : begin + n * n], n, n)
    normal = as_rows(spare[begin + size : begin + 2 * size], n + 1, n + 1)
    trial_normal = as_rows(spare[begin + 2 * size : begin + 3 * size], n + 1, n + 1)
    spare = spare[begin + 3 * size :]
    joint_prior(
        prior_mean, prior_covariance, chosen, figures, knots, count, constants, prior, information,
        spare,
    )  # fmt: skip
    for a in range(n):
        i = chosen[a]
        lower[a] = units[F_LOWER, i] if i < LEVEL else -LEVEL_BOUND if i >= KNOTS else -1e300
        upper[a] = units[F_UPPER, i] if i < LEVEL else LEVEL_BOUND if i >= KNOTS else 1e300
        p[i] = value[a] = min(max(p[i], lower[a]), upper[a])
    columns, taken = KNOTS + knots, (KNOTS + knots) * end
    rows = as_rows(scratch[:taken], columns, end)
    weights = as_rows(scratch[taken : taken + 4 * end], 4, end)
    jitter = units[F_UNIT, MASS] * p[MASS] * constants[C_POSITION_NOISE] / constants[C_PERIOD] ** 2
    sliding = not whole and tables[T_UNTIL, start] >= end
    turned = begun = fresh = 0.0
    cost, evaluations, halvings, done = math.inf, 0, 0, False
    while True:
        if reshaped:
            for k in range(end):
                ready[k] = 0
        if sliding:
            fill_slide(
                p, knots, units[F_UNIT], constants[C_VS:], constants[C_PERIOD], start, tables,
                heading, ready, wide, rows, elements,
            )  # fmt: skip
        else:
            turned, begun = fill_rows(
                p, knots, units[F_UNIT], constants[C_VS:], constants[C_POSITION_NOISE],
                constants[C_PERIOD], forces, report[R_KNOWN], report[R_REST_FORCE], tables, heading,
                ready, wide, evaluations == 0, rows, elements,
            )  # fmt: skip
        for i in range(LEVEL):
            led[i] = p[i]
        if evaluations == 0:  # the weights stay what they are at the first iterate
            for k in range(end):
                weights[3, k] = white + tables[T_HAZE, k]
            if report[R_CODES] > 0.0 and not linear:
                share_rounding(
                    tables[T_FORCE], rows[RESIDUAL], use[:end], report[R_CODES], jitter, weights[3]
                )
            if linear:
                _weigh_apart(weights[3], use[:end], weights[2])
            else:
                factor_weights(
                    units[F_UNIT, MASS] * p[MASS], units[F_UNIT, VISCOUS] * p[VISCOUS],
                    constants[C_PERIOD], constants[C_POSITION_NOISE], tables[T_STUCK], weights[3],
                    use[:end], weights[0], weights[1], weights[2],
                )  # fmt: skip
            pull = units[F_UNIT, STIFFNESS] * p[STIFFNESS] * constants[C_POSITION_NOISE]
            fresh = constants[C_SLIP_SPREAD] if whole else FREE_SLIP
            fresh *= units[F_UNIT, COULOMB] * p[COULOMB]
            for a in range(first, n):
                if chosen[a] == REST_FORCE:
                    open_left = white if apart else white + pull * pull
                elif chosen[a] == TURN_FORCE:
                    open_left = white + pull * pull + turned * turned
                elif chosen[a] == SLIP_FORCE:
                    open_left = fresh * fresh + begun * begun + 1e-20
                else:
                    open_left = 1.0
                information[a, a] = 1.0 / open_left
        if not linear:
            whiten(rows, chosen, weights[0], weights[1])
        normal_equations(rows, chosen, weights[2], trial_normal)
        evaluations += 1
        trial_cost = trial_normal[n, n]
        for a in range(n):
            away[a] = p[chosen[a]] - prior[a]
        trial_cost += quadratic_form(information, away)
        if trial_cost <= cost * (1.0 + 1e-12):
            cost, halvings = trial_cost, 0
            normal, trial_normal = trial_normal, normal
            for a in range(n):
                value[a] = p[chosen[a]]
            length = gauss_newton_into(
                normal[:n, :n], normal[:n, n], information, prior, value, lower, upper, spare, step
            )
            if not math.isfinite(length):
                report[R_FAILED] = 1.0
                return
            # Residuals are products of figures, and of figures and level: a step leaves about its
            # square. The offsets are linear.
            largest = 0.0
            for a in range(n):
                if a < figures:
                    share = step[a] / max(abs(value[a]), 0.5)
                    largest = max(largest, abs(share))
                    away[a] = step[a] * share
                else:
                    away[a] = step[a] * largest if a < first else 0.0
            left = quadratic_form(normal[:n, :n], away) + quadratic_form(information, away)
            # The last step is taken, but not evaluated once more.
            if (
                length < TOLERANCE
                or left < REMAINS * REMAINS
                or linear
                or evaluations > MAX_ITERATIONS
            ):
                normal[n, n] += quadratic_form(normal, step)
                for a in range(n):
                    normal[n, n] += 2.0 * step[a] * normal[a, n]
                for a in range(n):
                    value[a] = min(max(value[a] + step[a], lower[a]), upper[a])
                done = True
        elif evaluations == 1:  # not finite
            report[R_FAILED] = 1.0
            return
        else:
            halvings += 1
            done = halvings == HALVINGS
            for a in range(n):
                step[a] *= 0.5
        for a in range(n):
            beyond = 0.0 if done else step[a]
            p[chosen[a]] = min(max(value[a] + beyond, lower[a]), upper[a])
        if done:
            break
    report[R_EVALUATIONS] += evaluations
    report[R_SAMPLES] = counted
    conclude(
        whole, linear, figures, knots, chosen, value, lower, upper, normal, information, p,
        prior_mean, prior_covariance, mean, covariance, report,
    )  # fmt: skip


@kernel()
def conclude(  # type: ignore[no-untyped-def]
    whole, linear, figures, knots, chosen, value, lower, upper, normal, information, p,
    prior_mean, prior_covariance, mean, covariance, report,
):  # fmt: skip
    """Take a solution, and say what is believed with it.

    `normal` are the normal equations there, shape (n + 1, n + 1); `information` is the arrival
    cost's, and becomes the covariance; the others are those of `fit`. Of a `linear` solve on no
    bound the solution is all that is needed.
    """
    n = value.shape[0]
    for a in range(n):
        p[chosen[a]] = value[a]
        for b in range(n):
            information[a, b] += normal[a, b]
    report[R_CHI_B if whole else R_CHI_A] = normal[n, n] / max(report[R_SAMPLES], 1.0)
    for a in range(figures):
        if value[a] <= lower[a] or value[a] >= upper[a]:
            report[R_BOUND] = chosen[a]
    if linear and report[R_BOUND] < 0.0:  # the second solve says what is believed
        return
    if not cholesky_inverse(information):
        report[R_FAILED] = 1.0
        return
    believe(p, information, chosen, figures, knots, prior_mean, prior_covariance, mean, covariance)


@kernel()
def _choose(whole, moves, zone, usable, end, use):  # type: ignore[no-untyped-def]
    """Fill which rows count; returns the first one, where the rows may end, and how many count."""
    count = use.shape[0]
    begin_at, counted = count - count, count - count
    if whole:
        while begin_at < end and not moves and zone[begin_at] == REST:
            begin_at += 1
    else:
        end = count
    for k in range(count):
        use[k] = (usable[k] != 0) & (whole | (zone[k] == SLIDE))
    for k in range(begin_at):
        use[k] = 0
    for k in range(end, count):
        use[k] = 0
    for k in range(count):
        counted += use[k]
    start = begin_at
    while start < count and not use[start]:
        start += 1
    while not whole and end > 0 and not use[end - 1]:
        end -= 1
    return start, end, counted


@kernel()
def _weigh_apart(variance, use, inverse):  # type: ignore[no-untyped-def]
    """Weights of rows by themselves, as if the encoder were exact."""
    for k in range(use.shape[0]):
        inverse[k] = 1.0 / variance[k] if use[k] else 0.0


@kernel()
def _count(mask):  # type: ignore[no-untyped-def]
    """How many are set. A function, as numba would take a sum begun at 0 for that constant too."""
    number = 0
    for i in range(mask.shape[0]):
        number += mask[i]
    return number
