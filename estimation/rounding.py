"""What a rounded force says: an interval, not a figure with white noise.

Where a force runs through many codes from sample to sample, rounding is as good as white noise of
step/sqrt(12). Where it changes slowly, its error is a sawtooth that neighbouring samples share: the
middle of a code says hardly anything, its borders a lot. So every code counts as what it is, the
statement that the force was between two borders: a measurement with mean and variance of its own
stands for it, such that together with all that the other codes and the positions say it leaves the
same mean and variance of the force (expectation propagation: T. P. Minka, 2001). A few rounds of
weighted least squares find figures and measurements that agree.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import kernel
from estimation.least_squares import cholesky_inverse, gauss_newton_step
from estimation.whitening import factor_weights, normal_equations, whiten

SOFT = 0.01
"""Deviation of a border, in steps: what keeps a force just outside from being impossible."""
LEAST = 1e-3
"""Least information of a code, in 1/step^2 (white noise would be 12)."""
MOST_ROUNDS, ENOUGH = 24, 0.01
"""Rounds; a step of less than so many standard deviations ends them."""


@kernel()
def read_codes(force, doubt, step, away, variance):  # type: ignore[no-untyped-def]
    """Each code as a measurement that leaves the same mean and variance of the force as it does.

    Args:
        force: presumed, relative to the code's middle [N], shape (K,).
        doubt: variance of that [N^2], shape (K,).
        step: between codes [N].
        away: what is measured, relative to the code's middle, changed half the way [N], shape (K,).
        variance: of it, changed half the way [N^2], shape (K,).
    """
    least, soft = LEAST / step**2, SOFT * step
    for k in range(force.shape[0]):
        # What all but this code say.
        others = max(1.0 / doubt[k] - 1.0 / variance[k], 1e-6 / step**2)
        expected = (force[k] / doubt[k] - away[k] / variance[k]) / others
        spread = 1.0 / others
        mean, left = _code(expected, spread + soft * soft, step)
        # The border is soft: that part of the spread is not the force's.
        share = spread / (spread + soft * soft)
        mean, left = expected + share * mean, spread - share * share * left
        information = max(1.0 / max(left, 1e-9 * step**2) - others, least)
        pull = mean / max(left, 1e-9 * step**2) - expected * others
        # Half the way: where all depends on a few borders, doubt and weights would take turns.
        pull = 0.5 * (pull + away[k] / variance[k])
        variance[k] = 1.0 / (0.5 * (information + 1.0 / variance[k]))
        away[k] = pull * variance[k]


@kernel()
def _code(expected, variance, step):  # type: ignore[no-untyped-def]
    """By how much a normal variable's mean moves, and its variance falls, inside a code."""
    sigma = math.sqrt(variance)
    left, right = (-0.5 * step - expected) / sigma, (0.5 * step - expected) / sigma
    if min(-left, right) > 8.0:
        return 0.0, 0.0
    if max(left, -right) > 8.0:  # far outside: on the border
        border = -0.5 * step if left > 0.0 else 0.5 * step
        return border - expected, variance * (1.0 - 1.0 / max(left, -right) ** 2)
    root = math.sqrt(0.5)
    # Differences of what is small, not of what is nearly 1.
    if left > 0.0:
        inside = 0.5 * (math.erfc(left * root) - math.erfc(right * root))
    else:
        inside = 0.5 * (math.erfc(-right * root) - math.erfc(-left * root))
    at_left = math.exp(-0.5 * left * left) / math.sqrt(2.0 * math.pi)
    at_right = math.exp(-0.5 * right * right) / math.sqrt(2.0 * math.pi)
    slope = (at_left - at_right) / inside
    curvature = slope * slope + (right * at_right - left * at_left) / inside
    return slope * sigma, curvature * variance


@kernel()
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
        for a in range(n):
            for b in range(n):
                covariance[a, b] = information[a, b] + normal[a, b]
        if not cholesky_inverse(covariance):
            return
        # The force itself, as all positions and codes together have it, and its variance: what is
        # left of a code's own, and what the unknowns leave open.
        for a in range(n + 1):
            _whiten_back(rows[a], weights[0], weights[1], weights[2])
        _own_part(weights[0], weights[1], weights[2], doubt)
        for k in range(count):
            force[k] = away[k] + variance[k] * rows[n, k]
            open_left = 0.0
            for a in range(n):
                for b in range(n):
                    open_left += rows[a, k] * covariance[a, b] * rows[b, k]
            doubt[k] = variance[k] + variance[k] ** 2 * (open_left - doubt[k])
        read_codes(force, doubt, step, away, variance)


@kernel()
def _whiten_back(row, lower, lowest, inverse):  # type: ignore[no-untyped-def]
    """From a whitened row to the inverse covariance times the row, in place."""
    count = row.shape[0]
    after = later = 0.0
    for k in range(count - 1, -1, -1):
        pull = row[k] * inverse[k]
        if k + 1 < count:
            pull -= lower[k + 1] * after
        if k + 2 < count:
            pull -= lowest[k + 2] * later
        row[k] = pull
        after, later = pull, after


@kernel()
def _own_part(lower, lowest, inverse, diagonal):  # type: ignore[no-untyped-def]
    """Diagonal of the inverse covariance, from its factor (Takahashi's recursion)."""
    count = diagonal.shape[0]
    next_next = next_later = later_later = 0.0
    for k in range(count - 1, -1, -1):
        first = lower[k + 1] if k + 1 < count else 0.0
        second = lowest[k + 2] if k + 2 < count else 0.0
        here_next = -first * next_next - second * next_later
        here_later = -first * next_later - second * later_later
        diagonal[k] = inverse[k] - first * here_next - second * here_later
        later_later, next_later, next_next = next_next, here_next, diagonal[k]
