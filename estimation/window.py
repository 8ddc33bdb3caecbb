"""One move as two bounded least-squares problems with an arrival cost, compiled as a whole.

First zone A alone: it is linear in Coulomb force, viscous coefficient and mass, so one pass solves
it. Then all that is usable, from onset to rest, from zone A's solution and with the same arrival
cost: each sample counts once. Unknown besides the figures: the elements' force at rest before the
move and behind the last turn (what a position and a measured force there leave open), on request
the one at the beginning of zone A, and the level at knots joined by its Gauss-Markov process.

Residual and derivatives: `rows`; weights and normal equations: `whitening`; steps in a box:
`least_squares`.
"""

from __future__ import annotations

import math

import numba

from estimation.belief import ALPHA, COULOMB, LAG, LEVEL, MASS, RATE, STIFFNESS, VISCOUS
from estimation.least_squares import cholesky_inverse, gauss_newton_into, quadratic_form
from estimation.move_tables import (
    KNOTS,
    M_GOOD,
    M_HEADING,
    M_READY,
    M_UPSET,
    M_USABLE,
    M_USE,
    M_ZONE,
    MOST,
    MOST_KNOTS,
    OFFSETS,
    RESIDUAL,
    REST_FORCE,
    SLIP_FORCE,
    T_ACCELERATION,
    T_AT,
    T_FORCE,
    T_HAZE,
    T_POSITION,
    T_SHARE,
    T_SHARP,
    T_STUCK,
    T_UNTIL,
    T_VELOCITY,
    TURN_FORCE,
)
from estimation.rounding import refine
from estimation.rows import fill_rows, fill_slide
from estimation.whitening import (
    factor_weights,
    normal_equations,
    whiten,
)
from estimation.zones import REST, SLIDE, STICK, differences, find_stretches, find_turns, mark_zones

KNOT_SPACING = 0.1
"""Of the level's knots [s]: a fifth of its usual correlation time."""
LEVEL_BOUND = 0.2
FREE_SLIP = 0.3
"""Spread of the element forces where zone A begins, in a solve of zone A alone [Coulomb force]."""
QUIET = 0.1
"""Encoder noise as a force (m / T^2 times its rms) below which rounding is not white [steps]."""
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
MAX_ITERATIONS, HALVINGS, TOLERANCE, REMAINS = 20, 10, 1e-3, 0.03
"""Of Gauss-Newton; a step below TOLERANCE posterior standard deviations ends it, and one that
leaves at most REMAINS of them to go."""

# Constants of an axis, as a vector for the kernels.
(
    C_PERIOD, C_POSITION_NOISE, C_FORCE_NOISE, C_MODEL_ERROR, C_WANDER, C_CORRELATION, C_PEAK,
    C_SLIP_SPREAD, C_STEP, C_VS, C_DELTA,
) = range(11)  # fmt: skip
CONSTANTS = 11
# Rows of an axis' table of figures.
F_UNIT, F_LOWER, F_UPPER = range(3)

# What the kernels report.
(
    R_SLIDE, R_STICK, R_CHI_A, R_CHI_B, R_BOUND, R_EVALUATIONS, R_FAILED, R_SAMPLES, R_KNOWN,
    R_REST_FORCE, R_STEP, R_END, R_FAR, R_TOLD, R_STEADY,
) = range(15)  # fmt: skip
REPORT_SIZE = 15
"""Also what is passed on: Coulomb force in force before the move and force measured at rest [N],
resolution of the force [N], up to which row the move is used, whether it goes FULL_SLIP,
whether it can tell sigma0, and the share of the motion in which the force was not upset."""


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


@numba.njit(cache=True, error_model="numpy")
def knots_of(count, period, wander):  # type: ignore[no-untyped-def]
    """How many knots the level has in a move of so many rows."""
    if wander <= 0.0:
        return 0
    return min(max(2, 1 + round(count * period / KNOT_SPACING)), MOST_KNOTS)


@numba.njit(cache=True, error_model="numpy")
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
    moves = constants[C_FORCE_NOISE] < (
        units[F_UNIT, STIFFNESS] * p[STIFFNESS] * constants[C_POSITION_NOISE]
    )
    last = counted = 0
    start = count
    for k in range(count):
        moves = moves or zone[k] != REST
        if whole:
            use[k] = usable[k] != 0 and k < report[R_END] and moves
        else:
            use[k] = usable[k] != 0 and zone[k] == SLIDE
        if use[k]:
            start = min(start, k)
            last = k + 1
            counted += 1
    end = int(report[R_END]) if whole else last
    if whole:
        _first_stiffness(
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
    information = spare[begin : begin + n * n].reshape((n, n))
    normal = spare[begin + size : begin + 2 * size].reshape((n + 1, n + 1))
    trial_normal = spare[begin + 2 * size : begin + 3 * size].reshape((n + 1, n + 1))
    spare = spare[begin + 3 * size :]
    _arrival_cost(
        prior_mean, prior_covariance, chosen, figures, knots, count, constants, prior, information,
        spare,
    )  # fmt: skip
    for a in range(n):
        i = chosen[a]
        lower[a] = units[F_LOWER, i] if i < LEVEL else -LEVEL_BOUND if i >= KNOTS else -1e300
        upper[a] = units[F_UPPER, i] if i < LEVEL else LEVEL_BOUND if i >= KNOTS else 1e300
        p[i] = value[a] = min(max(p[i], lower[a]), upper[a])
    spread = constants[C_MODEL_ERROR] * units[F_UNIT, COULOMB] * prior_mean[COULOMB]
    white = constants[C_FORCE_NOISE] ** 2 + spread * spread
    columns, taken = KNOTS + knots, (KNOTS + knots) * end
    rows = scratch[:taken].reshape((columns, end))
    weights = scratch[taken : taken + 4 * end].reshape((4, end))
    # Where the encoder alone moves the force through codes, rounding is as good as white.
    jitter = units[F_UNIT, MASS] * p[MASS] * constants[C_POSITION_NOISE] / constants[C_PERIOD] ** 2
    refined = not linear and jitter < QUIET * report[R_STEP]
    sliding = not whole and tables[T_UNTIL, start] >= end
    turned = begun = 0.0
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
        if done:  # rows at the solution, not whitened
            break
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
        if done and not refined:
            break
    if refined:
        chi = normal[n, n]
        for k in range(end):
            weights[3, k] -= white
        for a in range(n):
            away[a] = value[a]
        refine(
            rows, chosen, away, tables[T_STUCK], weights[3], use[:end],
            units[F_UNIT, MASS] * p[MASS], units[F_UNIT, VISCOUS] * p[VISCOUS],
            constants[C_PERIOD], constants[C_POSITION_NOISE], report[R_STEP], prior,
            information, lower, upper, value, normal,
        )  # fmt: skip
        normal[n, n] = chi
    for a in range(n):
        p[chosen[a]] = value[a]
        for b in range(n):
            information[a, b] += normal[a, b]
    report[R_EVALUATIONS] += evaluations
    if not cholesky_inverse(information):
        report[R_FAILED] = 1.0
        return
    _believe(p, information, chosen, figures, knots, prior_mean, prior_covariance, mean, covariance)
    for a in range(figures):
        if value[a] <= lower[a] or value[a] >= upper[a]:
            report[R_BOUND] = chosen[a]
    report[R_SAMPLES] = counted
    report[R_CHI_B if whole else R_CHI_A] = normal[n, n] / max(counted, 1)


@numba.njit(cache=True, error_model="numpy")
def _count(mask):  # type: ignore[no-untyped-def]
    """How many are set. A function, as numba would take a sum begun at 0 for that constant too."""
    number = 0
    for i in range(mask.shape[0]):
        number += mask[i]
    return number


@numba.njit(cache=True, error_model="numpy")
def _first_stiffness(  # type: ignore[no-untyped-def]
    p, prior_mean, prior_covariance, zone, tables, use, forces, constants, units, report
):
    """Start zone B's problem at the stiffness that the onset shows while all elements stick."""
    known_coulomb, rest_force = report[R_KNOWN], report[R_REST_FORCE]
    coulomb = units[F_UNIT, COULOMB] * p[COULOMB]
    mass, viscous = units[F_UNIT, MASS] * p[MASS], units[F_UNIT, VISCOUS] * p[VISCOUS]
    n = forces.shape[0]
    up = down = 1e300
    for i in range(n):
        limit = 2.0 * (i + 1) / (n * (n + 1)) * coulomb
        force = forces[i] * coulomb / known_coulomb
        up, down = min(up, limit - force), min(down, limit + force)
    up, down = 0.8 * n * max(up, 0.0), -0.8 * n * max(down, 0.0)
    square = product = 0.0
    origin = tables[T_POSITION, 0]
    for k in range(zone.shape[0]):
        friction = (
            tables[T_FORCE, k + 1] - mass * tables[T_ACCELERATION, k]
            - viscous * tables[T_VELOCITY, k] - rest_force
        )  # fmt: skip
        if zone[k] == SLIDE or not down < friction < up or (not use[k] and zone[k] != REST):
            break
        travel = tables[T_POSITION, k + 1] - origin
        square += travel * travel
        product += travel * friction
    spread = constants[C_MODEL_ERROR] * coulomb
    outer = mass * constants[C_POSITION_NOISE] / constants[C_PERIOD] ** 2
    variance = constants[C_FORCE_NOISE] ** 2 + spread**2 + 6.0 * outer**2
    unit = units[F_UNIT, STIFFNESS]
    believed = 1.0 / prior_covariance[STIFFNESS, STIFFNESS]
    shown = square * unit**2 / variance
    found = (believed * prior_mean[STIFFNESS] + shown * product / max(square * unit, 1e-300)) / (
        believed + shown
    )
    p[STIFFNESS] = min(max(found, units[F_LOWER, STIFFNESS]), units[F_UPPER, STIFFNESS])


@numba.njit(cache=True, error_model="numpy")
def _arrival_cost(  # type: ignore[no-untyped-def]
    prior_mean, prior_covariance, chosen, figures, knots, count, constants, prior, information,
    room,
):  # fmt: skip
    """Joint prior of the chosen figures and the knots: mean and inverse covariance."""
    base = figures + 1 if knots > 0 else figures
    n = prior.shape[0]
    block = room[: base * base].reshape((base, base))
    for a in range(base):
        i = chosen[a] if a < figures else LEVEL
        for b in range(base):
            block[a, b] = prior_covariance[i, chosen[b] if b < figures else LEVEL]
    cholesky_inverse(block)
    for a in range(n):
        prior[a] = 0.0
        for b in range(n):
            information[a, b] = block[a, b] if a < base and b < base else 0.0
    for a in range(figures):
        prior[a] = prior_mean[chosen[a]]
    if knots > 0:
        gap = (count - 1) * constants[C_PERIOD] / (knots - 1)
        keep = math.exp(-gap / constants[C_CORRELATION])
        walk = (1.0 - keep**2) * constants[C_WANDER] ** 2 + 1e-12
        level = prior_mean[LEVEL]
        for j in range(figures, figures + knots):
            prior[j] = level
            level *= keep
        for j in range(figures, figures + knots - 1):
            information[j, j] += keep**2 / walk
            information[j, j + 1] -= keep / walk
            information[j + 1, j] -= keep / walk
            information[j + 1, j + 1] += 1.0 / walk


@numba.njit(cache=True, error_model="numpy")
def _believe(  # type: ignore[no-untyped-def]
    p, posterior, chosen, figures, knots, prior_mean, prior_covariance, mean, covariance
):
    """The belief after a fit: what was not solved for stays as it was."""
    for i in range(LEVEL + 1):
        mean[i] = prior_mean[i]
        for j in range(LEVEL + 1):
            covariance[i, j] = prior_covariance[i, j] if i == j else 0.0
    last = figures + knots - 1
    for a in range(figures):
        i = chosen[a]
        mean[i] = p[i]
        for b in range(figures):
            covariance[i, chosen[b]] = posterior[a, b]
        if knots > 0:
            covariance[i, LEVEL] = posterior[a, last]
            covariance[LEVEL, i] = posterior[last, a]
    if knots > 0:
        mean[LEVEL] = p[KNOTS + knots - 1]
        covariance[LEVEL, LEVEL] = posterior[last, last]
