"""What a rounded force says: an interval, not a figure with white noise.

Where a force runs through many codes from sample to sample, rounding is as good as white noise of
step/sqrt(12). Where it changes slowly, its error is a sawtooth that neighbouring samples share: the
middle of a code says hardly anything, its borders a lot. So every code counts as what it is, the
statement that the force, as the positions' rows explain it, was between two borders (softened by
`SOFT`). The logarithm of that is concave; its slope and curvature at the present force make
each sample a measurement with a variance of its own; a few rounds of weighted least squares find
the most probable figures (Newton's method, as for any generalised linear model).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from estimation.least_squares import cholesky_inverse, gauss_newton_step
from estimation.whitening import factor_weights, normal_equations, whiten

SOFT = 0.04
"""Deviation of a border, in steps."""
LEAST = 0.1
"""Least information of a code, in 1/step^2 (white noise would be 12)."""
MOST_ROUNDS, ENOUGH = 12, 0.03
"""Rounds; a step of less than so many standard deviations ends them."""


@numba.njit(cache=True, error_model="numpy")
def read_codes(force, doubt, step, away, variance):  # type: ignore[no-untyped-def]
    """Each code as a measurement that has the same slope and curvature of its log-likelihood.

    Args:
        force: presumed, relative to the code's middle [N], shape (K,).
        doubt: variance of that [N^2], shape (K,).
        step: between codes [N].
        away: what is measured, relative to the code's middle, written [N], shape (K,).
        variance: of it, changed half the way [N^2], shape (K,).
    """
    soft = SOFT * step
    for k in range(force.shape[0]):
        slope = curvature = 0.0
        for node in range(3):
            share = 2.0 / 3.0 if node == 0 else 1.0 / 6.0
            d = force[k] + (0.0 if node == 0 else math.sqrt(3.0 * doubt[k]) * (2 * node - 3))
            one, two = _code(d, soft, step)
            slope += share * one
            curvature += share * two
        # Half the way: where all depends on a few borders, doubt and weights would take turns.
        curvature = 0.5 * (max(curvature, LEAST / step**2) + 1.0 / variance[k])
        away[k] = force[k] + slope / curvature
        variance[k] = 1.0 / curvature


@numba.njit(cache=True, error_model="numpy")
def _code(d, soft, step):  # type: ignore[no-untyped-def]
    """Slope of a code's log-likelihood at a force, and minus its curvature."""
    left, right = (-0.5 * step - d) / soft, (0.5 * step - d) / soft
    if min(-left, right) > 6.0:
        return 0.0, 0.0
    if max(left, -right) > 6.0:  # far outside
        return (left if left > 0.0 else right) / soft, 1.0 / soft**2
    inside = 0.5 * (math.erf(right * math.sqrt(0.5)) - math.erf(left * math.sqrt(0.5)))
    at_left = math.exp(-0.5 * left * left) / math.sqrt(2.0 * math.pi)
    at_right = math.exp(-0.5 * right * right) / math.sqrt(2.0 * math.pi)
    slope = (at_left - at_right) / (inside * soft)
    return slope, slope * slope + (right * at_right - left * at_left) / (inside * soft**2)


@numba.njit(cache=True, error_model="numpy")
def refine(  # type: ignore[no-untyped-def]
    raw, chosen, at, stuck, haze, use, mass, viscous, period, noise, step, prior, information,
    lower, upper, value, normal,
):  # fmt: skip
    """From the solution under white rounding to the one that takes every code for what it is.

    Args:
        raw: residual and derivatives, not whitened, of which `chosen` are the unknowns' and, last,
            the residual, shape (*, >= K).
        chosen: shape (n + 1,).
        at: unknowns there, shape (n,).
        stuck: of `whitening.factor_weights`, shape (K,).
        haze: variance of the rows beside rounding [N^2], shape (K,).
        use: as `stuck`.
        mass: the same.
        viscous: the same.
        period: the same.
        noise: the same.
        step: of the force [N].
        prior: of `least_squares.gauss_newton_step`.
        information: the same.
        lower: the same.
        upper: the same.
        value: the solution; refined, shape (n,).
        normal: normal equations there, written, shape (n + 1, n + 1).
    """
    n, count = value.shape[0], use.shape[0]
    rows, order = np.empty((n + 1, count)), np.empty(n + 1, dtype=np.int8)
    weights, doubt, whole = np.empty((3, count)), np.empty(count), np.empty(count)
    covariance = np.empty((n, n))
    before = noise * (mass / period**2 - 0.5 * viscous / period)
    after_next = noise * (mass / period**2 + 0.5 * viscous / period)
    force, away, variance = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        away[k], variance[k] = 0.0, step * step / 12.0
    for a in range(n + 1):
        order[a] = a
    for number in range(MOST_ROUNDS):
        for k in range(count):
            whole[k] = variance[k] + haze[k]
            rows[n, k] = raw[chosen[n], k] - away[k]
        factor_weights(
            mass, viscous, period, noise, stuck, whole, use, weights[0], weights[1], weights[2],
        )  # fmt: skip
        for a in range(n):
            for k in range(count):
                rows[a, k] = raw[chosen[a], k]
                rows[n, k] += (value[a] - at[a]) * rows[a, k]
        whiten(rows, order, weights[0], weights[1])
        normal_equations(rows, order, weights[2], normal)
        change, size = gauss_newton_step(
            normal[:n, :n], normal[:n, n], information, prior, value, lower, upper
        )
        if not math.isfinite(size):
            return
        for a in range(n):
            value[a] = min(max(value[a] + change[a], lower[a]), upper[a])
            for k in range(count):
                rows[n, k] += change[a] * rows[a, k]
        if number > 1 and size < ENOUGH:
            return
        # The force itself, as the positions and its code together have it.
        after = later = 0.0
        for k in range(count - 1, -1, -1):
            pull = rows[n, k] * weights[2, k]
            if k + 1 < count:
                pull -= weights[0, k + 1] * after
            if k + 2 < count:
                pull -= weights[1, k + 2] * later
            force[k] = away[k] + variance[k] * pull
            after, later = pull, after
        for a in range(n):
            for b in range(n):
                covariance[a, b] = information[a, b] + normal[a, b]
        if not cholesky_inverse(covariance):
            return
        for k in range(count):
            here = noise * stuck[k] - before - after_next
            doubt[k] = 1.0 / (1.0 / variance[k] + 1.0 / (before**2 + after_next**2 + here**2))
            for a in range(n):
                for b in range(n):
                    doubt[k] += raw[chosen[a], k] * covariance[a, b] * raw[chosen[b], k]
        read_codes(force, doubt, step, away, variance)
