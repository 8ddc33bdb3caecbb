"""The arrival cost of a move, and the belief that follows from its solution.

Belief ages from move to move; what it says of the figures that a move is solved for, joined with
the level at its knots, is what the solve starts from.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel
from estimation.flat_room import as_rows
from estimation.least_squares import cholesky_inverse
from estimation.online.belief import COULOMB, LEVEL
from estimation.online.move_tables import KNOTS, MOST_KNOTS
from estimation.online.update_tables import C_CORRELATION, C_PERIOD, C_WANDER, F_DRIFT

KNOT_SPACING = 0.1
"""Of the level's knots [s]: a fifth of its usual correlation time."""


@kernel()
def age(mean, covariance, elapsed, restless, constants, units, after, spread):  # type: ignore[no-untyped-def]
    """The belief one move later: the figures drifted, the level partly forgotten."""
    for i in range(LEVEL + 1):
        after[i] = mean[i]
        for j in range(LEVEL + 1):
            spread[i, j] = covariance[i, j]
    for i in range(LEVEL):
        spread[i, i] += units[F_DRIFT, i] ** 2
    spread[COULOMB, COULOMB] += restless * mean[COULOMB] ** 2
    wander_on(after, spread, elapsed, constants)


@kernel()
def wander_on(mean, covariance, elapsed, constants):  # type: ignore[no-untyped-def]
    """The level partly forgotten, as it is after so many seconds; changed in place."""
    keep = math.exp(-max(elapsed, 0.0) / constants[C_CORRELATION])
    mean[LEVEL] *= keep
    for i in range(LEVEL):
        covariance[i, LEVEL] *= keep
        covariance[LEVEL, i] *= keep
    covariance[LEVEL, LEVEL] *= keep * keep
    covariance[LEVEL, LEVEL] += (1.0 - keep * keep) * constants[C_WANDER] ** 2 + 1e-12


@kernel()
def knots_of(count, period, wander):  # type: ignore[no-untyped-def]
    """How many knots the level has in a move of so many rows."""
    if wander <= 0.0:
        return 0
    return min(max(2, 1 + round(count * period / KNOT_SPACING)), MOST_KNOTS)


@kernel()
def joint_prior(  # type: ignore[no-untyped-def]
    prior_mean, prior_covariance, chosen, figures, knots, count, constants, prior, information,
    room,
):  # fmt: skip
    """Joint prior of the chosen figures and the knots: mean and inverse covariance."""
    base = figures + 1 if knots > 0 else figures
    n = prior.shape[0]
    block = as_rows(room[: base * base], base, base)
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


@kernel()
def believe(  # type: ignore[no-untyped-def]
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
