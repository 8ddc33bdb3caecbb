"""How much acts beside the model: in every sample, on the Coulomb force, and as a force of its own.

Empirical Bayes: a variance is the mean square of what was found in the moves, weighed by the share
of it that each of them determines, so that a move that says nothing changes nothing. None falls
below what the machine file says.
"""

from __future__ import annotations

import math

from stagedata.compiled import kernel

MODEL_ERROR, WANDER, UNMODELLED = range(3)
"""Places of their weights."""
LEAST_UNMODELLED = 0.003
"""Least rms of the unmodelled force, relative to the Coulomb force at the start."""


@kernel()
def learn_excess(axis, weights, missed, wander, unmodelled, coulomb, most):  # type: ignore[no-untyped-def]
    """Learn it from a move: `model_error`, `wander`, `unmodelled` and `excess` of the axis.

    Args:
        axis: settings, a record of `settings.AXIS`; updated.
        weights: of the variances, in moves that determine them, shape (3,); updated.
        missed: mean square of what the model missed, relative.
        wander: of the level: mean square found, and share of it that the move determines.
        unmodelled: the same of the unmodelled force.
        coulomb: Coulomb force in force, relative to that at the start.
        most: of `weights`.
    """
    usual, known = axis.usual_error**2, axis.usual_wander**2
    model_error = _mean(axis.model_error**2, weights, MODEL_ERROR, missed, 1.0, most)
    level = _mean(axis.wander**2, weights, WANDER, wander[0], wander[1], most)
    force = _mean(axis.unmodelled**2, weights, UNMODELLED, unmodelled[0], unmodelled[1], most)
    model_error, level = max(model_error, usual), max(level, known)
    force = max(force, LEAST_UNMODELLED**2)
    axis.model_error, axis.wander = math.sqrt(model_error), math.sqrt(level)
    axis.unmodelled = math.sqrt(force)
    axis.excess = math.sqrt(model_error - usual + (level - known) + force / coulomb**2)


@kernel()
def _mean(variance, weights, which, square, share, most):  # type: ignore[no-untyped-def]
    """Mean of a variance and another square that counts `share` of a move; see `learn_excess`."""
    mean = (weights[which] * variance + square) / (weights[which] + share)
    weights[which] = min(weights[which] + share, most)
    return mean
