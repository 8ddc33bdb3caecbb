"""The arrival cost of a move, and the belief that follows from its solution.

The belief ages from move to move. Its marginal over the figures that a move is solved for, together
with the Gauss-Markov priors of level and unmodelled force at their knots, is the arrival cost.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.least_squares import cholesky_inverse
from estimation.online.belief.belief import COULOMB, FORCE, LEVEL, MASS, STATES, Belief
from stagedata.compiled import kernel

MOST_KNOTS = 6
UNMODELLED_DRIFT = 0.3
"""Drift of the figures per move, as a share of what earlier moves had beside the model: where much
is missing from the model, its figures are only roughly constant."""
KNOT_SPACING = 0.2
"""Distance of the knots of level and unmodelled force, in correlation times."""


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
    for i in range(MASS):
        beside = axis.excess**2 + axis.scatter[i] ** 2
        aged.covariance[i, i] += beside * (UNMODELLED_DRIFT * belief.mean[i]) ** 2
    aged.covariance[COULOMB, COULOMB] += trend_variance * belief.mean[COULOMB] ** 2
    decay(aged, max(elapsed, 0.0) / axis.correlation_time, 0.0, axis)
    return aged


@kernel()
def copy(belief):  # type: ignore[no-untyped-def]
    """An independent copy: mean, shape (STATES,), and covariance, (STATES, STATES)."""
    return Belief(belief.mean.copy(), belief.covariance.copy())


@kernel()
def decay(belief, time, place, axis):  # type: ignore[no-untyped-def]
    """Let level and unmodelled force decay over time and place, in place.

    `time` in correlation times, `place` in correlation lengths.
    """
    mean, covariance = belief.mean, belief.covariance
    for i in range(LEVEL, STATES):
        rms = axis.wander if i == LEVEL else axis.unmodelled
        keep = math.exp(-(_level_progress(time, place, axis) if i == LEVEL else time + place))
        mean[i] *= keep
        for j in range(STATES):
            covariance[i, j] *= keep
            covariance[j, i] *= keep
        covariance[i, i] += (1.0 - keep * keep) * rms**2 + 1e-12


@kernel()
def _level_progress(time, place, axis):  # type: ignore[no-untyped-def]
    """Correlation times of the level: its part beyond the usual wander changes with place too."""
    if axis.wander <= axis.usual_wander:
        return time
    return time + place * (1.0 - (axis.usual_wander / axis.wander) ** 2)


@kernel()
def knots_of(progress, axis):  # type: ignore[no-untyped-def]
    """Number of knots of level and unmodelled force each.

    `progress`: of a move, in correlation times and lengths together.
    """
    if axis.wander <= 0.0 and axis.unmodelled <= 0.0:
        return 0
    return min(max(2, 1 + round(progress / KNOT_SPACING)), MOST_KNOTS)


@kernel()
def joint_prior(belief, chosen, figures, knots, forces, time, place, axis):  # type: ignore[no-untyped-def]
    """Prior of the chosen unknowns: mean, shape (n,), and inverse covariance, shape (n, n).

    Args:
        belief: before the move.
        chosen: the unknowns: first figures, then knots, then what has no prior here, shape (n,).
        figures: how many of them are figures.
        knots: how many are knots of the level, one Gauss-Markov process.
        forces: how many are knots of the unmodelled force, another one.
        time: of the move, in correlation times.
        place: way of the move, in correlation lengths.
        axis: its settings.
    """
    mean, covariance = belief.mean, belief.covariance
    n = chosen.shape[0]
    states, places, base = _known_of(chosen, figures, knots, forces)
    block = np.empty((base, base))
    for a in range(base):
        for b in range(base):
            block[a, b] = covariance[states[a], states[b]]
    cholesky_inverse(block)
    prior, information = np.zeros(n), np.zeros((n, n))
    for a in range(base):
        for b in range(base):
            information[places[a], places[b]] = block[a, b]
    for a in range(figures):
        prior[a] = mean[chosen[a]]
    gaps = max(knots, forces, 2) - 1
    if knots > 0:
        keep = math.exp(-_level_progress(time, place, axis) / gaps)
        _join_knots(figures, knots, mean[LEVEL], keep, axis.wander, prior, information)
    if forces > 0:
        at, keep = figures + knots, math.exp(-(time + place) / gaps)
        _join_knots(at, forces, mean[FORCE], keep, axis.unmodelled, prior, information)
    return prior, information


@kernel()
def _known_of(chosen, figures, knots, forces):  # type: ignore[no-untyped-def]
    """States of the belief that have unknowns, where these are, and how many there are.

    Arguments as of `joint_prior`. The first two: shape (figures + 2,).
    """
    states, places, base = np.empty(figures + 2, np.int64), np.empty(figures + 2, np.int64), figures
    for a in range(figures):
        states[a], places[a] = chosen[a], a
    if knots > 0:
        states[base], places[base] = LEVEL, figures
        base += 1
    if forces > 0:
        states[base], places[base] = FORCE, figures + knots
        base += 1
    return states, places, base


@kernel()
def _join_knots(first, number, begin, keep, rms, prior, information):  # type: ignore[no-untyped-def]
    """Prior of the knots of a Gauss-Markov process (7 arguments: those of `joint_prior`).

    Args:
        first: place of the first knot among the unknowns.
        number: of knots.
        begin: expectation of the first.
        keep: share of it that the next one keeps.
        rms: of the process.
        prior: means, shape (n,), written.
        information: inverse covariance, shape (n, n), added to.
    """
    walk = (1.0 - keep**2) * rms**2 + 1e-12
    for j in range(first, first + number):
        prior[j] = begin
        begin *= keep
    for j in range(first, first + number - 1):
        information[j, j] += keep**2 / walk
        information[j, j + 1] -= keep / walk
        information[j + 1, j] -= keep / walk
        information[j + 1, j + 1] += 1.0 / walk


@kernel()
def take_over(p, posterior, chosen, figures, knots, forces, before, after):  # type: ignore[no-untyped-def]
    """Write the belief after a solve.

    States that were not solved for keep mean and variance, and become independent of the others.

    Args:
        p: solution by unknown, shape (KNOTS + knots + forces,).
        posterior: covariance of the chosen ones, shape (n, n).
        chosen: as of `joint_prior`.
        figures: the same.
        knots: the same.
        forces: the same.
        before: belief before the move.
        after: belief after it, written.
    """
    found, uncertain = after.mean, after.covariance
    for i in range(STATES):
        found[i] = before.mean[i]
        for j in range(STATES):
            uncertain[i, j] = before.covariance[i, j] if i == j else 0.0
    states, places, base = _known_of(chosen, figures, knots, forces)
    if knots > 0:
        places[figures] += knots - 1
    if forces > 0:
        places[base - 1] += forces - 1
    for a in range(base):
        i, at = states[a], places[a]
        found[i] = p[chosen[at]]
        for b in range(base):
            uncertain[i, states[b]] = posterior[at, places[b]]
