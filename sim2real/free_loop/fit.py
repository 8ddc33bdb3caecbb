"""A model fitted to the free loop: Gauss-Newton, with the machine file's tolerance as a prior.

Source: docs/decisions/0014-free-loop.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sim2real.fitting import (
    MAX_SIGMAS,
    STEP,
    AxisModel,
    Fitted,
    Term,
    coordinates,
    effect_coordinates,
    invert_scaled,
    with_coordinates,
)
from sim2real.free_loop.loop import FreeLoop
from sim2real.held_out import FLOOR_LEVEL
from stagedata import F64, BoolArray

_BASE_STEP = 0.01
"""Relative step of the base parameters for difference quotients."""
_WIDER = 3.0
"""Difference steps of an effect's coordinates relative to those of the tracked fit: larger, because
the free loop contains the encoder's rounding."""
_PHASE_STEP, _PHASE_REACH = 0.1, 2.0
"""Largest change of phase at the end of the travel due to a step of a pitch or frequency, for
difference quotients and in one iteration [rad]."""
_DAMPING = (1e-4, 1e-2, 1e-1, 1.0)
"""Levenberg-Marquardt factors, tried at once."""
_CONVERGED = 0.05
"""A fit ends when the cost decreases by less than this."""


def fit_free(
    loop: FreeLoop,
    model: AxisModel,
    iterations: int,
    moves: BoolArray | None = None,
    base_columns: F64 | None = None,
) -> Fitted:
    """Fit base parameters and effects, starting from a model.

    Args:
        loop: the axis.
        model: to start from.
        iterations: at most.
        moves: that count, bool[moves]; None for all.
        base_columns: derivatives of the residual by the relative base parameters near the start,
            float64[R, STEP]: they hardly depend on the effects; computed when None.

    Raises:
        ValueError: the start is not physical.
    """
    residual = loop.residual(model)
    cost = free_cost(loop, model, residual, moves)
    counted = np.ones(len(residual), dtype=np.bool_) if moves is None else moves[loop.move]
    if base_columns is None:
        base_columns = derivatives(loop, model, residual, range(STEP))
    for _ in range(iterations):
        effects = range(STEP, STEP + sum(len(term.values) for term in model.terms))
        columns = np.hstack([base_columns, derivatives(loop, model, residual, effects)])[counted]
        where = _vector(loop, model)
        # An incomplete model's deviations are larger than noise; weights are smaller accordingly.
        weight = 1.0 / (loop.coherent * max(float(np.mean(residual[counted] ** 2)), 1.0))
        normal = weight * (columns.T @ columns)
        gradient = weight * (columns.T @ residual[counted])
        normal[:STEP, :STEP] += np.eye(STEP)  # the prior: base parameters are in sigmas
        gradient[:STEP] += where[:STEP]
        size = np.sqrt(np.diag(normal))
        size[size < 1e-9] = 1.0
        scaled, slope = normal / np.outer(size, size), -gradient / size
        trials = []
        for damping in _DAMPING:
            step = np.linalg.solve(scaled + damping * np.eye(len(size)), slope) / size
            trials.append(_model_at(loop, model, where + _limited(loop, model, step)))
        found = [
            (free_cost(loop, trial, left, moves), trial, left)
            for trial, left in zip(trials, loop.residuals(trials), strict=True)
            if left is not None
        ]
        best = min(found, key=lambda each: each[0], default=None)
        if best is None or best[0] >= cost:
            break
        gained = cost - best[0]
        cost, model, residual = best
        if gained < _CONVERGED:
            break
    return Fitted(model, cost, residual)


def derivatives(
    loop: FreeLoop, model: AxisModel, residual: F64, by: Sequence[int] | None = None
) -> F64:
    """Derivatives of the residual by base parameters (in sigmas) and coordinates, float64[R, P].

    One-sided differences: slips that shift to another sample average out over a recording.

    Args:
        loop: the axis.
        model: where.
        residual: what it leaves, float64[R].
        by: indices of the parameters; None for all.
    """
    where = _vector(loop, model)
    inward = np.where(where[:STEP] <= 0.0, _BASE_STEP, -_BASE_STEP) / loop.spread
    steps = [*inward, *(step for term in model.terms for step, _ in _strides(loop, term))]
    moved = {}
    by = range(len(steps)) if by is None else by
    for j in by:
        if j < STEP and not loop.has_figure[j]:
            continue
        there = where.copy()
        there[j] += steps[j]
        moved[j] = _model_at(loop, model, there)
        if j >= STEP and _vector(loop, moved[j])[j] == where[j]:  # at a limit
            there[j] -= 2.0 * steps[j]
            moved[j] = _model_at(loop, model, there)
    columns = np.zeros((len(residual), len(steps)))
    for (j, other), changed in zip(
        moved.items(), loop.residuals(list(moved.values())), strict=True
    ):
        change = _vector(loop, other)[j] - where[j]
        if changed is not None and change != 0.0:
            columns[:, j] = (changed - residual) / change
    return columns[:, list(by)]


def move_covariance(loop: FreeLoop, fitted: Fitted) -> F64:
    """Covariance of a fit, float64[P, P]: by the prior's noise and by the scatter between moves.

    Of the relative base parameters, then of the effects' coordinates in fitted units. The residual
    of an incomplete model is not noise; the disagreement between moves is a better measure
    (sandwich estimate, clustered by move).
    """
    inverse, columns, weight = _least_squares(loop, fitted)
    scores = np.zeros((len(loop.samples), columns.shape[1]))
    np.add.at(scores, loop.move, columns * (weight * fitted.residual)[:, None])
    return np.asarray(inverse + inverse @ (scores.T @ scores) @ inverse)


def least_squares_covariance(loop: FreeLoop, fitted: Fitted) -> F64:
    """Covariance of a fit if all that it leaves were noise, float64[P, P]."""
    return _least_squares(loop, fitted)[0]


def _least_squares(loop: FreeLoop, fitted: Fitted) -> tuple[F64, F64, float]:
    """Inverse of the normal matrix, derivatives float64[R, P], and weight of an element."""
    columns = derivatives(loop, fitted.model, fitted.residual)
    weight = 1.0 / (loop.coherent * max(float(np.mean(fitted.residual**2)), 1.0))
    normal = weight * (columns.T @ columns)
    normal[:STEP, :STEP] += np.eye(STEP)
    return np.asarray(invert_scaled(normal)), columns, weight


def free_cost(
    loop: FreeLoop, model: AxisModel, residual: F64, moves: BoolArray | None = None
) -> float:
    """Twice the negative log posterior, up to a constant.

    The size of an incomplete model's deviations is not known beforehand: the likelihood term is the
    logarithm of their energy times the number of independent residual elements.
    """
    samples = float(loop.samples.sum() if moves is None else loop.samples[moves].sum())
    energy = max(loop.gap(residual, moves), FLOOR_LEVEL)
    prior = float(np.square(model.base[:STEP] / loop.spread).sum())
    return 2.0 * samples / loop.coherent * math.log(energy) + prior


def _vector(loop: FreeLoop, model: AxisModel) -> F64:
    """Base parameters in sigmas, then the coordinates of all effects, float64[P]."""
    return np.append(model.base[:STEP] / loop.spread, effect_coordinates(model, loop.axis))


def _model_at(loop: FreeLoop, like: AxisModel, where: F64) -> AxisModel:
    """The model at these coordinates, within its limits."""
    base = like.base.copy()
    base[:STEP] = np.clip(where[:STEP], -MAX_SIGMAS, MAX_SIGMAS) * loop.spread
    return with_coordinates(like, loop.axis, base, where[STEP:])


def _limited(loop: FreeLoop, model: AxisModel, step: F64) -> F64:
    """The step, shortened so that no coordinate moves beyond its reach."""
    reach = [MAX_SIGMAS] * STEP
    for term in model.terms:
        reach += [far for _, far in _strides(loop, term)]
    shares = np.array(reach) / np.maximum(np.abs(step), 1e-12)
    return np.asarray(step * min(1.0, float(shares.min())))


def _strides(loop: FreeLoop, term: Term) -> list[tuple[float, float]]:
    """Step for differences and largest change in one iteration, of each coordinate of a term.

    A small change of pitch puts a wave out of phase by the end of the travel: its steps are small.
    """
    strides = []
    periodic = any(p.role == "phase" for p in term.effect.parameters)
    for entry, value in zip(coordinates(term.effect, loop.axis), term.values, strict=True):
        step, reach = _WIDER * entry.step, 2.0 * entry.reach
        if periodic and entry.parameter.role == "shape":
            over_travel = entry.parameter.unit == "m"
            turns = loop.extent / value if over_travel else loop.duration * value
            turn = 2.0 * math.pi * max(turns, 0.2)
            per_log = 1.0 if entry.log else value / entry.scale
            step = min(step, _PHASE_STEP / turn * per_log)
            reach = min(reach, _PHASE_REACH / turn * per_log)
        strides.append((step, reach))
    return strides
