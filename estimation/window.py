"""One move as two bounded least-squares problems with an arrival cost, compiled as a whole.

The residual is measured force minus friction model minus apparent mass times acceleration, the
model driven by the measured positions from the friction state at rest before the move. Encoder
noise enters it through the second difference, so neighbouring residuals are correlated: they are
whitened by the Cholesky factor of their covariance, not low-pass filtered. Inside the move the
level w is an unknown at a few knots, joined by its Gauss-Markov process, so that the wander of a
real stage is modelled and not averaged into the figures.

First zone A alone, then all that moved from its solution and with the same arrival cost: each
sample counts once.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from estimation.belief import COULOMB, LEVEL, MASS, RATE, STIFFNESS, VISCOUS
from estimation.gms import (
    ALPHA,
    E_BY_COULOMB,
    REST_BAND,
    S_BY_COULOMB,
    S_BY_RATE,
    S_BY_STIFFNESS,
    S_REFERENCE,
    S_TOTAL,
    advance,
    correct_forces,
    follow_positions,
    pack,
)
from estimation.gms import COULOMB as MODEL_COULOMB
from estimation.gms import RATE as MODEL_RATE
from estimation.gms import STIFFNESS as MODEL_STIFFNESS
from estimation.least_squares import cholesky_inverse, gauss_newton_step
from estimation.zones import SLIDE, STICK, differences, mark_zones

KNOT_SPACING = 0.1
"""Of the level's knots [s]: a fifth of its usual correlation time."""
LEVEL_BOUND = 0.2
SUBSTEPS = 4
"""Of the friction model inside a sample that is not far above the Stribeck velocity."""
MIN_SLIDE, MIN_STICK = 12, 6
"""Fewest samples of a zone that is worth solving."""
MAX_ITERATIONS, HALVINGS, TOLERANCE = 20, 10, 0.05
"""Of Gauss-Newton; a step below TOLERANCE posterior standard deviations ends it."""

_STATIONARY = 1e-6  # the Cholesky factor has become so constant that it is not renewed

# Constants of an axis, as a vector for the kernel.
C_PERIOD, C_MASS, C_POSITION_NOISE, C_FORCE_NOISE, C_MODEL_ERROR = range(5)
C_WANDER, C_CORRELATION, C_LOWER, C_UPPER, C_PEAK = range(5, 10)

# What the kernel reports.
R_SLIDE, R_STICK, R_CHI_A, R_CHI_B, R_BOUND, R_EVALUATIONS, R_FAILED = range(7)
REPORT_SIZE = 7


@numba.njit(cache=True, error_model="numpy")
def estimate_move(  # type: ignore[no-untyped-def]
    position, force, valid, constants, figures, shape, shares, known_coulomb, forces, slipping,
    direction, rest_force, mean, covariance, free_a, free_b, free_ab, stick_counts, report,
):  # fmt: skip
    """Both zones of one move.

    `figures`: what the relative figures are relative to; `shape`: `Friction.vector` whose Coulomb
    force, stiffness and rate the figures replace; `forces`, `slipping`, `direction`: friction state
    at rest before the move under a Coulomb force of `known_coulomb`; `mean`, `covariance`: belief
    before the move, overwritten by the belief after it; `free_a`, `free_b`, `free_ab`: figures to
    solve for in zone A, in a move without zone A, and in one that has both.
    Chi-squares in `report` are means over their zones' samples; R_BOUND is a figure on its bound,
    or -1; R_FAILED is 1 where a problem had no solution.
    """
    count = position.shape[0] - 2
    velocity, acceleration = np.empty(count), np.empty(count)
    usable = np.empty(count, dtype=np.bool_)
    differences(position, valid, constants[C_PERIOD], velocity, acceleration, usable)
    zone = np.zeros(count, dtype=np.int8)
    breakaway = (
        2.0 / (shares.shape[0] + 1) * (1.0 + shape[ALPHA]) * known_coulomb * shares.shape[0]
        / (figures[STIFFNESS] * mean[STIFFNESS])
    )  # fmt: skip
    mark_zones(position, velocity, breakaway, shape[3], zone)
    slide = stick = 0
    for k in range(count):
        if abs(force[k + 1]) >= constants[C_PEAK]:
            usable[k] = False
        if usable[k]:
            slide += zone[k] == SLIDE
            stick += zone[k] == STICK
    report[R_SLIDE] = slide if slide >= MIN_SLIDE else 0.0
    report[R_STICK] = stick if stick_counts and stick >= MIN_STICK else 0.0
    report[R_CHI_A] = report[R_CHI_B] = report[R_EVALUATIONS] = report[R_FAILED] = 0.0
    report[R_BOUND] = -1.0
    wandering = constants[C_WANDER] > 0.0
    knots = max(2, 1 + round(count * constants[C_PERIOD] / KNOT_SPACING)) if wandering else 0
    p = np.zeros(LEVEL + knots)
    p[:LEVEL] = mean[:LEVEL]
    prior_mean, prior_covariance = mean.copy(), covariance.copy()
    data = (
        position, velocity, acceleration, force, usable, zone, constants, figures, shape, shares,
        known_coulomb, forces, slipping, direction, rest_force,
    )  # fmt: skip
    if report[R_SLIDE] > 0.0:
        report[R_CHI_A] = _fit(
            p, prior_mean, prior_covariance, mean, covariance, free_a, SLIDE, knots, data, report
        )
    if report[R_STICK] > 0.0 and report[R_FAILED] == 0.0 and report[R_BOUND] < 0.0:
        report[R_CHI_B] = _fit(
            p,
            prior_mean,
            prior_covariance,
            mean,
            covariance,
            free_ab if report[R_SLIDE] > 0.0 else free_b,
            STICK,
            knots,
            data,
            report,
        )


@numba.njit(cache=True, error_model="numpy")
def final_state(  # type: ignore[no-untyped-def]
    position, valid, period, model, shares, known_coulomb, forces, slipping, memory, rest_force
):
    """Carry the friction state in place from the rest before a move to its end under `model`.

    The state is scaled from a Coulomb force of `known_coulomb` and made to agree with the force
    measured at rest.
    """
    count = position.shape[0] - 2
    velocity, acceleration = np.empty(count), np.empty(count)
    usable = np.empty(count, dtype=np.bool_)
    differences(position, valid, period, velocity, acceleration, usable)
    forces *= model[MODEL_COULOMB] / known_coulomb
    correct_forces(forces, shares, model[MODEL_COULOMB] * (1.0 + model[ALPHA]), rest_force)
    memory[1] = position[0]
    follow_positions(
        model, shares, forces, slipping, memory, position[1:-1], velocity, period, SUBSTEPS,
        REST_BAND, np.empty(count), np.empty((count, 3)),
    )  # fmt: skip


@numba.njit(cache=True, error_model="numpy")
def _fit(  # type: ignore[no-untyped-def]
    p, prior_mean, prior_covariance, mean, covariance, free, zone_from, knots, data, report
):
    """Gauss-Newton over the free figures and the level's knots; returns the mean chi-square.

    `p` is the first iterate and becomes the solution; `mean`, `covariance` become the belief.
    """
    constants = data[6]
    chosen = np.nonzero(free)[0]
    figures, n = chosen.shape[0], chosen.shape[0] + knots
    active = np.empty(n, dtype=np.int64)
    active[:figures] = chosen
    for j in range(knots):
        active[figures + j] = LEVEL + j
    prior, information = _arrival_cost(
        prior_mean, prior_covariance, chosen, knots, data[0].shape[0] - 2, constants
    )
    lower, upper = np.empty(n), np.empty(n)
    for a in range(n):
        lower[a] = constants[C_LOWER] if a < figures else -LEVEL_BOUND
        upper[a] = constants[C_UPPER] if a < figures else LEVEL_BOUND
    for i in range(LEVEL):
        if not free[i]:
            p[i] = prior_mean[i]
    value = np.empty(n)
    for a in range(n):
        value[a] = min(max(p[active[a]], lower[a]), upper[a])
        p[active[a]] = value[a]
    # Noise of the first iterate's Coulomb level: the weights do not move with the unknowns.
    spread = constants[C_MODEL_ERROR] * data[7][COULOMB] * prior_mean[COULOMB]
    white = constants[C_FORCE_NOISE] ** 2 + spread**2
    curvature, slope = np.empty((n, n)), np.empty(n)
    trial_curvature, trial_slope = np.empty((n, n)), np.empty(n)
    chi, samples = normal_equations(p, active, zone_from, knots, white, data, curvature, slope)
    cost = chi + _away(value, prior, information)
    evaluations = 1
    for _ in range(MAX_ITERATIONS):
        if not math.isfinite(cost):
            report[R_FAILED] = 1.0
            return 0.0
        step, size = gauss_newton_step(curvature, slope, information, prior, value, lower, upper)
        if not math.isfinite(size):
            report[R_FAILED] = 1.0
            return 0.0
        if size < TOLERANCE:  # within the accuracy wanted: taken, but not evaluated once more
            for a in range(n):
                value[a] = min(max(value[a] + step[a], lower[a]), upper[a])
                p[active[a]] = value[a]
            break
        improved = False
        for _ in range(HALVINGS):
            for a in range(n):
                p[active[a]] = min(max(value[a] + step[a], lower[a]), upper[a])
            trial_chi, _s = normal_equations(
                p, active, zone_from, knots, white, data, trial_curvature, trial_slope
            )
            evaluations += 1
            trial = np.empty(n)
            for a in range(n):
                trial[a] = p[active[a]]
            trial_cost = trial_chi + _away(trial, prior, information)
            if trial_cost <= cost * (1.0 + 1e-12):
                value, cost, chi = trial, trial_cost, trial_chi
                curvature, trial_curvature = trial_curvature, curvature
                slope, trial_slope = trial_slope, slope
                improved = True
                break
            step = step * 0.5
        if not improved:
            for a in range(n):
                p[active[a]] = value[a]
            break
    report[R_EVALUATIONS] += evaluations
    posterior = information + curvature
    if not cholesky_inverse(posterior):
        report[R_FAILED] = 1.0
        return 0.0
    _believe(p, posterior, chosen, knots, prior_mean, prior_covariance, mean, covariance)
    for a in range(figures):
        if value[a] <= lower[a] or value[a] >= upper[a]:
            report[R_BOUND] = chosen[a]
    return chi / max(samples, 1)


@numba.njit(cache=True, error_model="numpy")
def _arrival_cost(prior_mean, prior_covariance, chosen, knots, count, constants):  # type: ignore[no-untyped-def]
    """Joint prior of the chosen figures and the knots: mean and inverse covariance."""
    figures = chosen.shape[0]
    n = figures + knots
    base = figures + 1 if knots > 0 else figures
    information = np.zeros((n, n))
    block = np.empty((base, base))
    place = np.empty(base, dtype=np.int64)
    place[:figures] = chosen
    if knots > 0:
        place[figures] = LEVEL
    for a in range(base):
        for b in range(base):
            block[a, b] = prior_covariance[place[a], place[b]]
    cholesky_inverse(block)
    information[:base, :base] = block
    prior = np.empty(n)
    for a in range(figures):
        prior[a] = prior_mean[chosen[a]]
    if knots > 0:
        gap = (count - 1) * constants[C_PERIOD] / (knots - 1)
        keep = math.exp(-gap / constants[C_CORRELATION])
        walk = (1.0 - keep**2) * constants[C_WANDER] ** 2 + 1e-12
        level = prior_mean[LEVEL]
        for j in range(knots):
            prior[figures + j] = level
            level *= keep
        for j in range(figures, n - 1):
            information[j, j] += keep**2 / walk
            information[j, j + 1] -= keep / walk
            information[j + 1, j] -= keep / walk
            information[j + 1, j + 1] += 1.0 / walk
    return prior, information


@numba.njit(cache=True, error_model="numpy")
def _believe(p, posterior, chosen, knots, prior_mean, prior_covariance, mean, covariance):  # type: ignore[no-untyped-def]
    """The belief after a fit: what was not solved for stays as it was."""
    figures = chosen.shape[0]
    mean[:] = prior_mean
    covariance[:] = prior_covariance
    for i in range(LEVEL + 1):
        for j in range(LEVEL + 1):
            if i != j:
                covariance[i, j] = 0.0
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
        mean[LEVEL] = p[LEVEL + knots - 1]
        covariance[LEVEL, LEVEL] = posterior[last, last]


@numba.njit(cache=True, error_model="numpy")
def _away(value, prior, information):  # type: ignore[no-untyped-def]
    """Arrival cost."""
    total = 0.0
    for i in range(value.shape[0]):
        for j in range(value.shape[0]):
            total += (value[i] - prior[i]) * information[i, j] * (value[j] - prior[j])
    return total


@numba.njit(cache=True, error_model="numpy")
def normal_equations(p, active, zone_from, knots, white, data, curvature, slope):  # type: ignore[no-untyped-def]
    """Fill J'J and J'r of the whitened residual r (predicted minus measured); return r'r, samples.

    `p`: all relative figures, then the level at each knot; `active`: the unknowns among them;
    `zone_from`: samples of this zone (SLIDE) or of all that moved (STICK) count; `white`: variance
    of the residual beside encoder noise [N^2].
    """
    (
        position, velocity, acceleration, force, usable, zone, constants, figures, shape, shares,
        known_coulomb, forces, slipping, direction, rest_force,
    ) = data  # fmt: skip
    count, n = shares.shape[0], active.shape[0]
    period = constants[C_PERIOD]
    model = shape.copy()
    coulomb = figures[COULOMB] * p[COULOMB]
    model[MODEL_COULOMB] = coulomb
    model[MODEL_STIFFNESS] = figures[STIFFNESS] * p[STIFFNESS]
    model[MODEL_RATE] = figures[RATE] * p[RATE]
    viscous, mass = figures[VISCOUS] * p[VISCOUS], figures[MASS] * p[MASS]
    # The rest scales with the Coulomb force, but its sum is what was measured.
    state = forces * (coulomb / known_coulomb)
    correct_forces(state, shares, coulomb * (1.0 + shape[ALPHA]), rest_force)
    elements, scalars = pack(model, shares, state, slipping, direction, position[0], period)
    mean = state.mean()
    for i in range(count):
        elements[E_BY_COULOMB, i] = (state[i] - mean) / coulomb
    # Residuals k, k-1, k-2 share encoder noise: covariance c0, c1, c2, factored row by row.
    noise = (constants[C_MASS] * constants[C_POSITION_NOISE] / period**2) ** 2
    c0, c1, c2 = 6.0 * noise + white, -4.0 * noise, noise
    this, last, older = np.zeros(n), np.zeros(n), np.zeros(n)  # whitened rows k, k-1, k-2
    r_last = r_older = 0.0
    pivot, before, off, first, second, inverse = 1.0, 1.0, 0.0, 0.0, 0.0, 1.0
    run = 0  # samples since the last gap
    row = np.zeros(LEVEL)
    curvature[:] = 0.0
    slope[:] = 0.0
    chi = 0.0
    used = 0
    samples = position.shape[0] - 2
    end = samples
    while end > 0 and zone[end - 1] < zone_from:
        end -= 1
    for k in range(end):
        if abs(position[k + 1] - scalars[S_REFERENCE]) > REST_BAND:
            v1 = velocity[k]
            v0 = velocity[k - 1] if k > 0 else v1
            advance(elements, scalars, position[k + 1], v0, v1, period, SUBSTEPS)
        if not usable[k] or zone[k] < zone_from:
            run = 0
            continue
        by_coulomb = scalars[S_BY_COULOMB]
        scale = coulomb * by_coulomb
        predicted = scalars[S_TOTAL] + viscous * velocity[k] + mass * acceleration[k]
        share, knot = 0.0, 0
        if knots > 0:  # the level is linear between knots
            place = k * (knots - 1) / (samples - 1)
            knot = min(int(place), knots - 2)
            share = place - knot
            level = p[LEVEL + knot] * (1.0 - share) + p[LEVEL + knot + 1] * share
            predicted += level * scale
        row[COULOMB] = by_coulomb * figures[COULOMB]
        row[VISCOUS] = velocity[k] * figures[VISCOUS]
        row[STIFFNESS] = scalars[S_BY_STIFFNESS] * figures[STIFFNESS]
        row[RATE] = scalars[S_BY_RATE] * figures[RATE]
        row[MASS] = acceleration[k] * figures[MASS]
        # Row of the Cholesky factor: two entries left of the pivot.
        if run < 3 or abs(pivot - before) > _STATIONARY * pivot:
            second = c2 / before if run > 1 else 0.0
            first = (c1 - second * off) / pivot if run > 0 else 0.0
            before = pivot
            pivot = math.sqrt(c0 - first * first - second * second)
            off = first
            inverse = 1.0 / pivot
        for a in range(n):
            i = active[a]
            if i < LEVEL:
                entry = row[i]
            elif i == LEVEL + knot:
                entry = scale * (1.0 - share)
            elif i == LEVEL + knot + 1:
                entry = scale * share
            else:
                entry = 0.0
            this[a] = (entry - first * last[a] - second * older[a]) * inverse
        residual = (predicted - force[k + 1] - first * r_last - second * r_older) * inverse
        r_older, r_last = r_last, residual
        chi += residual * residual
        for a in range(n):
            entry = this[a]
            slope[a] += entry * residual
            for b in range(a + 1):
                curvature[a, b] += entry * this[b]
        older, last, this = last, this, older
        run += 1
        used += 1
    for a in range(n):
        for b in range(a):
            curvature[b, a] = curvature[a, b]
    return chi, used
