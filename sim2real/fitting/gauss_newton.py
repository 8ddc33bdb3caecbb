"""Fitting a model of one axis to tracked recordings: bounded Gauss-Newton on the innovations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sim2real.fitting.axis_model import MAX_REFINEMENT, MAX_SIGMAS, NUISANCES, STEP, AxisModel
from sim2real.fitting.axis_problem import AxisProblem, Fitted, agreeing_slope
from sim2real.fitting.coordinates import (
    Coordinate,
    coordinates,
    effect_coordinates,
    from_coordinates,
    to_coordinates,
    with_coordinates,
)
from sim2real.fitting.normal_equations import (
    information_matrix,
    invert_scaled,
    sandwich_covariance,
    solve_scaled,
)
from stagedata import F64

_SIGNATURE_STEP = 0.05
"""Change of an effect's signature, relative, that the step of a difference quotient aims at."""
_REACH = 0.6
"""Largest relative change of its signature that an effect's parameter may make per iteration."""
_STEP_SHARES = (0.3, 0.05)
"""Shares of a step that are tried where the whole step raises the cost."""
_SLOPE_TRIALS = 3
"""Steps that a difference quotient may try."""
_SETTLED = (0.5, 1e-4)
"""Reduction of the cost below which the iteration ends: absolute, and beside it relative."""
_SLACK = 30.0
"""Rise of the cost allowed to each step of a thorough fit: slips make the cost rough, and where the
data determine nothing the prior must prevail."""


def fit(
    problem: AxisProblem,
    model: AxisModel,
    iterations: int = 4,
    base_columns: F64 | None = None,
    thorough: bool = True,
) -> Fitted:
    """Fit base parameters and effects of a model, starting from its values.

    Args:
        problem: what is fitted to.
        model: the start, effects included.
        iterations: of Gauss-Newton, at most.
        base_columns: derivatives of the residual by the relative base parameters near the start,
            float64[R, NUISANCES]; computed when None.
        thorough: make all iterations, also where the cost hardly falls (`_SETTLED`), let a step
            raise it by up to `_SLACK`, and compute the covariance at the end.
    """
    residual = problem.residual(model)
    cost = problem.cost(model, residual)
    if base_columns is None:
        base_columns = problem.base_columns(model, residual)
    steps: list[F64] = [np.full(len(t.values), np.nan) for t in model.terms]
    done, falling = 0, 0.0
    while True:
        last = done >= iterations
        if last and not thorough:
            return Fitted(model, cost, residual, None, falling)
        columns, reach = _effect_columns(problem, model, residual, steps, both=last)
        jacobian = np.hstack([base_columns, columns])
        weights = problem.weights(residual)
        normal, gradient = _normal_equations(problem, model, jacobian, residual, weights)
        if last:
            scores = jacobian * (weights * residual)[:, None]
            covariance = sandwich_covariance(invert_scaled(normal), scores)
            return Fitted(model, cost, residual, covariance)
        gradient[:NUISANCES] += model.base / problem.spread**2
        limit = np.concatenate((10.0 * problem.spread, reach))
        step = _within_limits(
            model, -solve_scaled(normal, gradient), normal, gradient, problem.spread
        )
        done += 1
        below = cost + (_SLACK if thorough else 0.0)
        taken = _descend(problem, model, below, step, limit) if np.isfinite(step).all() else None
        if taken is None:
            done, falling = iterations, 0.0
            continue
        trial, trial_residual, trial_cost = taken
        falling = cost - trial_cost
        if falling < _SETTLED[0] + _SETTLED[1] * cost and not thorough:
            done, falling = iterations, 0.0
        model, residual, cost = trial, trial_residual, trial_cost


def _normal_equations(
    problem: AxisProblem, model: AxisModel, jacobian: F64, residual: F64, weights: F64
) -> tuple[F64, F64]:
    """Normal matrix float64[P, P], prior included, and the gradient of the data, float64[P]."""
    known, gradient = information_matrix(
        jacobian * np.sqrt(weights)[:, None],
        jacobian.T @ (weights * residual),
        [len(t.values) for t in model.terms],
    )
    prior = np.zeros(jacobian.shape[1])
    prior[:NUISANCES] = 1.0 / problem.spread**2
    return known + np.diag(prior), gradient


def _within_limits(model: AxisModel, step: F64, normal: F64, gradient: F64, spread: F64) -> F64:
    """The step, solved again with those base parameters fixed that would leave their limits.

    Clipped afterwards, they would leave the others a step that only fits an unclipped one.
    """
    low, high = _limits(spread)
    free = np.ones(len(step), dtype=np.bool_)
    for _ in range(NUISANCES):
        own = step[:NUISANCES]
        beyond = ((model.base >= high) & (own > 0.0)) | ((model.base <= low) & (own < 0.0))
        if not beyond.any() or not np.isfinite(step).all():
            break
        free[:NUISANCES] &= ~beyond
        step = np.zeros(len(step))
        step[free] = -solve_scaled(normal[np.ix_(free, free)], gradient[free])
    return step


def _limits(spread: F64) -> tuple[F64, F64]:
    """Limits of the base parameters and the refinement, float64[NUISANCES] each."""
    low, high = -MAX_SIGMAS * spread, MAX_SIGMAS * spread
    low[STEP], high[STEP] = 0.0, MAX_REFINEMENT
    return low, high


def _descend(
    problem: AxisProblem, model: AxisModel, below: float, step: F64, limit: F64
) -> tuple[AxisModel, F64, float] | None:
    """The model after a step, its residual and cost; None where the cost stays above `below`.

    First the step is tried with each coordinate clipped to its limit. If that does not lower the
    cost, parts of the step are tried, clipped likewise, and the step shortened as a whole until no
    coordinate exceeds its limit.
    """
    whole = step * min(1.0, float(np.min(limit / np.maximum(np.abs(step), 1e-300))))
    parts = [np.clip(shrink * step, -limit, limit) for shrink in (1.0, *_STEP_SHARES)]
    for steps in (parts[:1], [*parts[1:], whole]):
        trials = [_apply_step(model, problem, each) for each in steps]
        residuals = problem.residuals_or_worst(trials)
        costs = [problem.cost(t, r) for t, r in zip(trials, residuals, strict=True)]
        best = int(np.argmin(costs))
        if costs[best] < below:
            return trials[best], residuals[best], costs[best]
    return None


@dataclass(slots=True, eq=False)
class _Slope:
    """Derivative of the residual by one coordinate of one effect, in progress.

    Attributes:
        index: of the effect in the model.
        j: index of the coordinate in the effect.
        entry: the coordinate.
        start: present coordinates of the effect, float64[parameters].
        step: to be tried next.
        taken: the last one tried.
        change: of the residual by it, float64[R].
    """

    index: int
    j: int
    entry: Coordinate
    start: F64
    step: float
    taken: float
    change: F64

    def where(self, step: float) -> F64:
        """All coordinates after a step of this one."""
        where = self.start.copy()
        where[self.j] += step
        return where

    def inward(self) -> float:
        """The next step, turned away from a limit that it would exceed."""
        here, there = self.start[self.j], self.start[self.j] + self.step
        return -self.step if self.entry.outward(there) == self.entry.outward(here) else self.step

    def tried(self, change: F64, size: float) -> bool:
        """Whether a step changed the residual enough; else the next step is set.

        Args:
            change: of the residual, float64[R].
            size: of the effect's signature.
        """
        self.change, self.taken = change, self.step
        moves = float(np.linalg.norm(change)) / size
        if (
            _SIGNATURE_STEP / 5.0 < moves < _SIGNATURE_STEP * 5.0
            or abs(self.step) >= self.entry.reach
        ):
            return True
        wider = self.step * min(max(_SIGNATURE_STEP / (moves + 1e-12), 1e-3), 1e3)
        self.step = float(np.clip(wider, -self.entry.reach, self.entry.reach))
        return False


def _effect_columns(
    problem: AxisProblem, model: AxisModel, residual: F64, steps: list[F64], both: bool = False
) -> tuple[F64, F64]:
    """Derivatives by all effects' coordinates, and their reach; `steps` are updated."""
    slopes = []
    for index, term in enumerate(model.terms):
        start = to_coordinates(term, problem.axis)
        for j, entry in enumerate(coordinates(term.effect, problem.axis)):
            step = float(steps[index][j])
            step = step if np.isfinite(step) else 0.1 * entry.step
            slopes.append(_Slope(index, j, entry, start, step, step, residual))
    bare = [model.without(index) for index in range(len(model.terms))]
    sizes: list[float] = []
    pending = slopes
    for _ in range(_SLOPE_TRIALS):
        for slope in pending:
            slope.step = slope.inward()
        models = [_with_term(problem, model, s.index, s.where(s.step)) for s in pending]
        residuals = problem.residuals_or_worst([*models, *(() if sizes else bare)])
        sizes = sizes or [
            float(np.linalg.norm(r - residual)) + 1e-9 for r in residuals[len(models) :]
        ]
        pending = [
            slope
            for slope, there in zip(pending, residuals, strict=False)
            if not slope.tried(there - residual, sizes[slope.index])
        ]
        if not pending:
            break
    columns = [slope.change / slope.taken for slope in slopes]
    if both:
        models = [_with_term(problem, model, s.index, s.where(-s.taken)) for s in slopes]
        residuals = problem.residuals_or_worst(models)
        columns = [
            agreeing_slope(column, (residual - there) / slope.taken)
            for column, there, slope in zip(columns, residuals, slopes, strict=True)
        ]
    reach = np.empty(len(slopes))
    for k, (slope, column) in enumerate(zip(slopes, columns, strict=True)):
        size, norm = sizes[slope.index], float(np.linalg.norm(column)) + 1e-12
        reach[k] = min(slope.entry.reach, _REACH * size / norm)
        best = np.clip(_SIGNATURE_STEP * size / norm, 1e-7, slope.entry.reach)
        steps[slope.index][slope.j] = best * np.sign(slope.taken)
    return np.column_stack(columns) if columns else np.empty((len(residual), 0)), reach


def _with_term(problem: AxisProblem, model: AxisModel, index: int, where: F64) -> AxisModel:
    """The model with one effect at other coordinates."""
    shifted = from_coordinates(model.terms[index], problem.axis, where)
    return replace(model, terms=(*model.terms[:index], shifted, *model.terms[index + 1 :]))


def _apply_step(model: AxisModel, problem: AxisProblem, step: F64) -> AxisModel:
    """The model after a step of base parameters and all effects' coordinates."""
    base = np.clip(model.base + step[:NUISANCES], *_limits(problem.spread))
    where = effect_coordinates(model, problem.axis) + step[NUISANCES:]
    return with_coordinates(model, problem.axis, base, where)
