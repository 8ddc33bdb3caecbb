"""Fitting a model of one axis to tracked recordings: bounded Gauss-Newton on the innovations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim2real.axis_model import (
    FARTHEST,
    FINEST,
    NUISANCES,
    STEP,
    AxisModel,
    coordinates,
    fitted,
    moved,
)
from sim2real.axis_problem import AxisProblem, Fitted, agreed
from sim2real.normal_equations import information, inverse, robust, solve

F64 = NDArray[np.float64]

_COLUMN = 0.05
"""A parameter's step for differences changes so much of its effect's signature."""
_REACH = 0.6
"""The most of its signature that an effect's parameter may change in one iteration."""
_SLACK = 30.0
"""Rise of the cost that a last step may bring: slips make it rough, and where the data are silent
the prior has to be heard."""


def fit(
    problem: AxisProblem,
    model: AxisModel,
    iterations: int = 4,
    base_columns: F64 | None = None,
    settled: float = 0.5,
    thorough: bool = True,
) -> Fitted:
    """Fit base parameters and effects of a model, from where it is.

    Args:
        problem: what to fit to.
        model: where to start, effects included.
        iterations: of Gauss-Newton, at most.
        base_columns: derivatives by the base parameters near here; worked out when None.
        settled: the cost that an iteration must gain for another one to be tried.
        thorough: work out the covariance at the end.
    """
    residual = problem.residual(model)
    cost = problem.cost(model, residual)
    if base_columns is None:
        base_columns = problem.base_columns(model, residual)
    steps: list[F64] = [np.full(len(t.values), np.nan) for t in model.terms]
    done = 0
    while True:
        last = done >= iterations
        if last and not thorough:
            return Fitted(model, cost, residual, None)
        columns, reach = _effect_columns(problem, model, residual, steps, both=last)
        jacobian = np.hstack([base_columns, *columns]) if columns else base_columns
        weights = problem.weights(residual)
        known, gradient = information(
            jacobian * np.sqrt(weights)[:, None],
            jacobian.T @ (weights * residual),
            [len(t.values) for t in model.terms],
        )
        prior = np.zeros(jacobian.shape[1])
        prior[:NUISANCES] = 1.0 / problem.spread**2
        normal = known + np.diag(prior)
        if last:
            scores = jacobian * (weights * residual)[:, None]
            covariance = robust(inverse(normal), scores)
            return Fitted(model, cost, residual, covariance)
        gradient[:NUISANCES] += model.base / problem.spread**2
        limit = np.concatenate((10.0 * problem.spread, *reach))
        step = -solve(normal, gradient)
        done += 1
        if not np.isfinite(step).all():
            done = iterations
            continue
        for shrink in (1.0, 0.3, 0.05):
            trial = _moved(model, problem, np.clip(shrink * step, -limit, limit))
            trial_residual = problem.attempted(trial)
            trial_cost = problem.cost(trial, trial_residual)
            if trial_cost < cost + (_SLACK if thorough else 0.0):
                break
        else:
            done = iterations
            continue
        if cost - trial_cost < settled + 1e-4 * cost and not thorough:
            done = iterations
        model, residual, cost = trial, trial_residual, trial_cost


def _effect_columns(
    problem: AxisProblem, model: AxisModel, residual: F64, steps: list[F64], both: bool = False
) -> tuple[list[F64], list[F64]]:
    """Derivatives by each effect's coordinates and how far each may move; `steps` are kept."""
    found = [
        _columns_of(problem, model, residual, index, steps[index], both)
        for index in range(len(model.terms))
    ]
    return [columns for columns, _ in found], [reach for _, reach in found]


def _columns_of(
    problem: AxisProblem, model: AxisModel, residual: F64, index: int, steps: F64, both: bool
) -> tuple[F64, F64]:
    """The same of one effect."""
    term = model.terms[index]
    start = fitted(term, problem.axis)
    signature = problem.residual(model.without(index)) - residual
    size = float(np.linalg.norm(signature)) + 1e-9
    entries = coordinates(term.effect, problem.axis)

    def slope(j: int) -> tuple[F64, float]:
        coordinate = entries[j]
        step = steps[j] if np.isfinite(steps[j]) else 0.1 * coordinate.step
        for _ in range(3):
            where = start.copy()
            where[j] += step
            if coordinate.outward(where[j]) == coordinate.outward(start[j]):
                step = -step
                where[j] = start[j] + step
            change = _with_term(problem, model, index, where) - residual
            moves = float(np.linalg.norm(change)) / size
            if _COLUMN / 5.0 < moves < _COLUMN * 5.0 or abs(step) >= coordinate.reach:
                break
            wider = step * min(max(_COLUMN / (moves + 1e-12), 1e-3), 1e3)
            step = float(np.clip(wider, -coordinate.reach, coordinate.reach))
        own = change / step
        if both:
            where[j] = start[j] - step
            other = residual - _with_term(problem, model, index, where)
            own = agreed(own, other / step)
        return own, step

    columns, reach = np.empty((len(residual), len(entries))), np.empty(len(entries))
    for j, (own, step) in enumerate(problem.workers.map(slope, range(len(entries)))):
        norm = float(np.linalg.norm(own)) + 1e-12
        reach[j] = min(entries[j].reach, _REACH * size / norm)
        best = np.clip(_COLUMN * size / norm, 1e-7, entries[j].reach)
        steps[j] = best * np.sign(step)
        columns[:, j] = own
    return columns, reach


def _with_term(problem: AxisProblem, model: AxisModel, index: int, where: F64) -> F64:
    """Residual with one effect at other coordinates."""
    shifted = moved(model.terms[index], problem.axis, where)
    terms = (*model.terms[:index], shifted, *model.terms[index + 1 :])
    return problem.attempted(replace(model, terms=terms))


def _moved(model: AxisModel, problem: AxisProblem, step: F64) -> AxisModel:
    """The model after a step of base parameters and all effects' coordinates."""
    terms, at = [], NUISANCES
    for term in model.terms:
        width = len(term.values)
        terms.append(moved(term, problem.axis, fitted(term, problem.axis) + step[at : at + width]))
        at += width
    limit = FARTHEST * problem.spread
    base = np.clip(model.base + step[:NUISANCES], -limit, limit)
    base[STEP] = min(max(base[STEP], 0.0), FINEST)
    return AxisModel(base, tuple(terms))
