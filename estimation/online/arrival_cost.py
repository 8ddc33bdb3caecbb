"""The arrival cost of a move, and the belief that follows from its solution.

Belief ages from move to move. Its marginal over the figures that a move is solved for, joined with
the level at its knots, is the arrival cost of the solve.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import kernel
from estimation.least_squares import cholesky_inverse
from estimation.online.belief import COULOMB, KNOTS, LEVEL, Belief

MOST_KNOTS = 8
KNOT_SPACING = 0.1
"""Of the level's knots [s]: a fifth of its usual correlation time."""


@kernel()
def age(belief, elapsed, trend_variance, axis):  # type: ignore[no-untyped-def]
    """The belief one move later: the figures have drifted, the level is partly forgotten.

    Args:
        belief: after the last move; not changed.
        elapsed: since then [s].
        trend_variance: variance by which Coulomb force ages beside its drift, relative.
        axis: its settings.
    """
    aged = copy(belief)
    for i in range(LEVEL):
        aged.covariance[i, i] += axis.drift[i] ** 2
    aged.covariance[COULOMB, COULOMB] += trend_variance * belief.mean[COULOMB] ** 2
    decay_level(aged, elapsed, axis)
    return aged


@kernel()
def copy(belief):  # type: ignore[no-untyped-def]
    """An independent copy: mean, shape (LEVEL + 1,), and covariance, (LEVEL + 1, LEVEL + 1)."""
    return Belief(belief.mean.copy(), belief.covariance.copy())


@kernel()
def decay_level(belief, elapsed, axis):  # type: ignore[no-untyped-def]
    """Let the level of `belief` decay over `elapsed` [s], in place; `axis`: its settings."""
    mean, covariance = belief.mean, belief.covariance
    keep = math.exp(-max(elapsed, 0.0) / axis.correlation_time)
    mean[LEVEL] *= keep
    for i in range(LEVEL):
        covariance[i, LEVEL] *= keep
        covariance[LEVEL, i] *= keep
    covariance[LEVEL, LEVEL] *= keep * keep
    covariance[LEVEL, LEVEL] += (1.0 - keep * keep) * axis.wander**2 + 1e-12


@kernel()
def knots_of(count, period, wander):  # type: ignore[no-untyped-def]
    """Number of knots of the level in a move of `count` rows, `period` [s] apart."""
    if wander <= 0.0:
        return 0
    return min(max(2, 1 + round(count * period / KNOT_SPACING)), MOST_KNOTS)


@kernel()
def joint_prior(belief, chosen, figures, knots, count, axis):  # type: ignore[no-untyped-def]
    """Prior of the chosen unknowns: mean, shape (n,), and inverse covariance, shape (n, n).

    Args:
        belief: before the move.
        chosen: the unknowns: first figures, then knots, then what has no prior here, shape (n,).
        figures: how many of them are figures.
        knots: how many are knots of the level, one Gauss-Markov process.
        count: rows of the move.
        axis: its settings.
    """
    mean, covariance = belief.mean, belief.covariance
    n, base = chosen.shape[0], figures + 1 if knots > 0 else figures
    block = np.empty((base, base))
    for a in range(base):
        i = chosen[a] if a < figures else LEVEL
        for b in range(base):
            block[a, b] = covariance[i, chosen[b] if b < figures else LEVEL]
    cholesky_inverse(block)
    prior, information = np.zeros(n), np.zeros((n, n))
    for a in range(base):
        for b in range(base):
            information[a, b] = block[a, b]
    for a in range(figures):
        prior[a] = mean[chosen[a]]
    if knots > 0:
        gap = (count - 1) * axis.period / (knots - 1)
        keep = math.exp(-gap / axis.correlation_time)
        walk = (1.0 - keep**2) * axis.wander**2 + 1e-12
        level = mean[LEVEL]
        for j in range(figures, figures + knots):
            prior[j] = level
            level *= keep
        for j in range(figures, figures + knots - 1):
            information[j, j] += keep**2 / walk
            information[j, j + 1] -= keep / walk
            information[j + 1, j] -= keep / walk
            information[j + 1, j + 1] += 1.0 / walk
    return prior, information


@kernel()
def take_over(p, posterior, chosen, figures, knots, before, after):  # type: ignore[no-untyped-def]
    """Write the belief after a solve: what was not solved for stays.

    Args:
        p: solution by unknown, shape (KNOTS + knots,).
        posterior: covariance of the chosen ones, shape (n, n).
        chosen: as of `joint_prior`.
        figures: the same.
        knots: the same.
        before: belief before the move.
        after: belief after it, written.
    """
    found, uncertain = after.mean, after.covariance
    for i in range(LEVEL + 1):
        found[i] = before.mean[i]
        for j in range(LEVEL + 1):
            uncertain[i, j] = before.covariance[i, j] if i == j else 0.0
    last = figures + knots - 1
    for a in range(figures):
        i = chosen[a]
        found[i] = p[i]
        for b in range(figures):
            uncertain[i, chosen[b]] = posterior[a, b]
        if knots > 0:
            uncertain[i, LEVEL] = posterior[a, last]
            uncertain[LEVEL, i] = posterior[last, a]
    if knots > 0:
        found[LEVEL] = p[KNOTS + knots - 1]
        uncertain[LEVEL, LEVEL] = posterior[last, last]
