"""Fitting a model of one axis to tracked recordings: bounded Gauss-Newton on the innovations.

What is minimised is twice the negative log posterior: the sum of squares of the innovations over
their standard deviation (position) and of the force actual's deviations over theirs, plus the base
parameters' deviations over the machine file's tolerance, squared. The filter's gains are those of
one run, first of the nominal model, then of what was found: so all models are weighed alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import AxisSettings
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
from sim2real.recording import BoolArray
from sim2real.tracking import Gains, Track, Tracker

F64 = NDArray[np.float64]

_BASE_STEP = 0.01
"""Relative step of the base parameters for differences: wide enough for single slips to average."""
_UNLIKE, _UNLIKE_STEP = 0.5, 0.2
"""Standard deviation of how far a stage is from the simulator's steps, and its own step for
differences."""
_COLUMN = 0.05
"""A parameter's step for differences changes so much of its effect's signature."""
_REACH = 0.6
"""The most of its signature that an effect's parameter may change in one iteration."""
_CANCELLED = 5e-2
"""Share of squared columns that is left where they cancel, below which it is their error."""
_OUTLIER = 4.0
"""Deviations beyond so many sigma count less and less: breakaways are events, not findings."""
_BLOCK = 250
"""Samples over which what a model leaves may repeat itself."""
_SLOW = 8
"""Samples whose mean shows structure that a single one hides."""
_EVENTS = 0.03
"""Share of an axis' time that is left out of its structure."""
_WHITE = 0.55
"""Structure below this is none; nominal stages reach 0.5."""
_SLACK = 30.0
"""Rise of the cost that a last step may bring: slips make it rough, and where the data are silent
the prior has to be heard."""
_NEARLY_WHITE = 0.6
"""The same for what is left in the end, where a stage need not be stepped as the simulator is."""
_CUT = 1e4
"""Deviations are kept within so many sigma, where a model makes the stage run away."""


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A model fitted to an axis.

    Attributes:
        model: at the minimum.
        cost: there: twice the negative log posterior up to a constant.
        residual: weighted deviations there, float64[R].
        covariance: of base parameters and all effects' fitted coordinates, in order; None where
            it was not asked for.
        evaluations: tracked runs that it took.
    """

    model: AxisModel
    cost: float
    residual: F64
    covariance: F64 | None
    evaluations: int


class AxisProblem:
    """One axis of one or several recordings of the same stage.

    Args:
        trackers: of the axis, one per recording.
        tolerance: relative standard deviation of the base parameters.
    """

    def __init__(self, trackers: Sequence[Tracker], tolerance: float) -> None:
        self.trackers = tuple(trackers)
        self.axis = trackers[0].axis
        self.spread: F64 = np.append(np.full(STEP, tolerance), _UNLIKE)
        self.start = AxisModel(np.zeros(NUISANCES))
        first = [tracker.run(self.axis) for tracker in trackers]
        self.gains: tuple[Gains, ...] = tuple(gains for _, gains in first)
        self.tracks: tuple[Track, ...] = tuple(track for track, _ in first)
        self.masks: tuple[BoolArray, ...] = tuple(track.valid for track in self.tracks)
        self.evaluations = len(trackers)
        self.outlier = _OUTLIER

    def finer(self) -> AxisProblem:
        """The same problem, simulated in the reference's steps."""
        other = object.__new__(AxisProblem)
        other.__dict__.update(self.__dict__)
        other.trackers = tuple(tracker.finer() for tracker in self.trackers)
        return other

    def beside(self, others: Sequence[AxisSettings]) -> None:
        """Take the other axes as these from now on, for effects that feel them."""
        self.trackers = tuple(tracker.beside(others) for tracker in self.trackers)

    def masked(self, masks: Sequence[BoolArray]) -> AxisProblem:
        """The same problem on some of the samples only (of those that are valid)."""
        other = object.__new__(AxisProblem)
        other.__dict__.update(self.__dict__)
        other.masks = tuple(
            track.valid & mask for track, mask in zip(self.tracks, masks, strict=True)
        )
        other.evaluations = 0
        return other

    def track(self, model: AxisModel) -> tuple[Track, ...]:
        """The recordings tracked under a model."""
        settings = model.settings(self.axis)
        self.evaluations += len(self.trackers)
        return tuple(
            tracker.run(settings, gains, model.fine)[0]
            for tracker, gains in zip(self.trackers, self.gains, strict=True)
        )

    def weighted(self, tracks: Sequence[Track]) -> F64:
        """Weighted deviations of tracked recordings, positions then forces, float64[R]."""
        parts = [t.position[m] for t, m in zip(tracks, self.masks, strict=True)]
        parts += [t.force[m] for t, m in zip(tracks, self.masks, strict=True)]
        return np.clip(np.nan_to_num(np.concatenate(parts), nan=_CUT), -_CUT, _CUT)

    def residual(self, model: AxisModel) -> F64:
        """Weighted deviations under a model, float64[R].

        Raises:
            ValueError: values that physics does not allow.
        """
        return self.weighted(self.track(model))

    def attempted(self, model: AxisModel) -> F64:
        """Weighted deviations under a model, the largest ones under a model that cannot be."""
        try:
            return self.residual(model)
        except ValueError:
            return np.full(2 * sum(int(mask.sum()) for mask in self.masks), _CUT)

    def cost(self, model: AxisModel, residual: F64) -> float:
        """Twice the negative log posterior."""
        loss = self.outlier**2 * np.log1p(np.square(residual / self.outlier)).sum()
        return float(loss) + float(np.square(model.base / self.spread).sum())

    def expected(self) -> float:
        """Cost of a model that leaves nothing but noise."""
        samples = 2 * sum(int(mask.sum()) for mask in self.masks)
        nodes, weights = np.polynomial.hermite_e.hermegauss(40)
        loss = self.outlier**2 * np.log1p(np.square(nodes / self.outlier))
        return float(samples * (weights @ loss) / weights.sum())

    def weights(self, residual: F64) -> F64:
        """Weights with which least squares has the gradient of the cost, float64[R]."""
        return np.asarray(1.0 / (1.0 + np.square(residual / self.outlier)))

    def rescale(self, residual: F64) -> None:
        """Take deviations for outliers beyond a few of those that are usual by now."""
        usual = float(np.sqrt(np.mean(np.square(np.clip(residual, -20.0, 20.0)))))
        self.outlier = _OUTLIER * max(1.0, usual)

    def regain(self, model: AxisModel) -> None:
        """Take the filter's gains from a run of this model: every cost is another one then."""
        settings = model.settings(self.axis)
        self.evaluations += len(self.trackers)
        self.gains = tuple(tracker.run(settings, None, model.fine)[1] for tracker in self.trackers)

    def revalued(self, fitted: Fitted) -> Fitted:
        """The same model with residual and cost as gains and outliers count by now."""
        residual = self.residual(fitted.model)
        return replace(fitted, residual=residual, cost=self.cost(fitted.model, residual))

    def at_start(self) -> Fitted:
        """The nominal model as it is."""
        residual = self.weighted(self.tracks)
        return Fitted(self.start, self.cost(self.start, residual), residual, None, 0)

    def recosted(self, fitted: Fitted) -> Fitted:
        """The same fit with its cost as outliers count by now."""
        return replace(fitted, cost=self.cost(fitted.model, fitted.residual))

    def white(self, residual: F64) -> bool:
        """Whether what is left looks like noise."""
        return structure(self.positions(residual)) < _WHITE

    def nearly_white(self, residual: F64) -> bool:
        """Whether what is left is no more than another integrator may leave."""
        return structure(self.positions(residual)) < _NEARLY_WHITE

    def positions(self, residual: F64) -> F64:
        """The positions' part of weighted deviations."""
        return residual[: sum(int(m.sum()) for m in self.masks)]

    def base_columns(self, model: AxisModel, residual: F64) -> F64:
        """Derivatives of the residual by the nuisance parameters, float64[R, NUISANCES]."""
        columns = np.empty((len(residual), NUISANCES))
        for j in range(NUISANCES):
            sides = []
            steps = (_BASE_STEP, -_BASE_STEP)
            if j == STEP:  # to one side: neither coarser than the simulator nor infinitely fine
                way = _UNLIKE_STEP if model.base[j] < 0.5 * FINEST else -_UNLIKE_STEP
                steps = (way, 2.0 * way)
            for step in steps:
                base = model.base.copy()
                base[j] += step
                sides.append((self.residual(replace(model, base=base)) - residual) / step)
            columns[:, j] = _agreed(*sides)
        return columns


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
    before = problem.evaluations
    residual = problem.residual(model)
    cost = problem.cost(model, residual)
    if base_columns is None:
        base_columns = problem.base_columns(model, residual)
    steps: list[F64] = [np.full(len(t.values), np.nan) for t in model.terms]
    done = 0
    while True:
        last = done >= iterations
        if last and not thorough:
            return Fitted(model, cost, residual, None, problem.evaluations - before)
        columns, reach = _effect_columns(problem, model, residual, steps, both=last)
        jacobian = np.hstack([base_columns, *columns]) if columns else base_columns
        weights = problem.weights(residual)
        information, gradient = _information(
            jacobian * np.sqrt(weights)[:, None],
            jacobian.T @ (weights * residual),
            [len(t.values) for t in model.terms],
        )
        prior = np.zeros(jacobian.shape[1])
        prior[:NUISANCES] = 1.0 / problem.spread**2
        normal = information + np.diag(prior)
        if last:
            scores = jacobian * (weights * residual)[:, None]
            covariance = _robust(_inverse(normal), scores)
            return Fitted(model, cost, residual, covariance, problem.evaluations - before)
        gradient[:NUISANCES] += model.base / problem.spread**2
        limit = np.concatenate((10.0 * problem.spread, *reach))
        step = -_solve(normal, gradient)
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


def _agreed(one: F64, other: F64) -> F64:
    """Slope that steps to both sides agree on: the smaller one, 0 where their signs differ.

    A slip that comes a sample earlier on one side is an event, not a derivative.
    """
    smaller = np.where(np.abs(one) < np.abs(other), one, other)
    return np.asarray(np.where(one * other > 0.0, smaller, 0.0))


def _effect_columns(
    problem: AxisProblem, model: AxisModel, residual: F64, steps: list[F64], both: bool = False
) -> tuple[list[F64], list[F64]]:
    """Derivatives by each effect's coordinates and how far each may move; `steps` are kept."""
    columns, reaches = [], []
    for t, term in enumerate(model.terms):
        start = fitted(term, problem.axis)
        signature = problem.residual(model.without(t)) - residual
        size = float(np.linalg.norm(signature)) + 1e-9
        own = np.empty((len(residual), len(start)))
        reach = np.empty(len(start))
        for j, coordinate in enumerate(coordinates(term.effect, problem.axis)):
            step = steps[t][j] if np.isfinite(steps[t][j]) else 0.1 * coordinate.step
            for _ in range(3):
                where = start.copy()
                where[j] += step
                if coordinate.outward(where[j]) == coordinate.outward(start[j]):
                    step = -step
                    where[j] = start[j] + step
                change = _with_term(problem, model, t, where) - residual
                moves = float(np.linalg.norm(change)) / size
                if _COLUMN / 5.0 < moves < _COLUMN * 5.0 or abs(step) >= coordinate.reach:
                    break
                wider = step * min(max(_COLUMN / (moves + 1e-12), 1e-3), 1e3)
                step = float(np.clip(wider, -coordinate.reach, coordinate.reach))
            own[:, j] = change / step
            if both:
                where[j] = start[j] - step
                other = residual - _with_term(problem, model, t, where)
                own[:, j] = _agreed(own[:, j], other / step)
            norm = float(np.linalg.norm(own[:, j])) + 1e-12
            reach[j] = min(coordinate.reach, _REACH * size / norm)
            best = np.clip(_COLUMN * size / norm, 1e-7, coordinate.reach)
            steps[t][j] = best * np.sign(step)
        columns.append(own)
        reaches.append(reach)
    return columns, reaches


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


def structure(innovations: F64) -> float:
    """How far innovations are from white: energy of their slow part over what noise would have.

    About 1 for white noise of the size that the filter expects. The loudest few parts in a hundred
    are left out: breakaways that no model foretells.
    """
    count = len(innovations) // _SLOW
    blocks = innovations[: count * _SLOW].reshape(count, _SLOW)
    energy = np.sort(np.square(blocks.sum(axis=1))) / _SLOW
    return float(np.mean(energy[: max(1, round((1.0 - _EVENTS) * count))]))


def _information(jacobian: F64, gradient: F64, blocks: Sequence[int]) -> tuple[F64, F64]:
    """J'J and gradient without the directions in which blocks of columns cancel one another.

    Differences over slipping elements are not exact: what is left where large columns cancel is
    their error, not information. Within an effect's own block nothing is dropped.
    """
    count = jacobian.shape[1]
    back = np.zeros((count, count))
    for j in range(NUISANCES):
        size = np.linalg.norm(jacobian[:, j])
        back[j, j] = 1.0 / size if size > 1e-100 else 0.0  # nothing is known of it
    at = NUISANCES
    for width in blocks:
        own = slice(at, at + width)
        back[own, own] = np.linalg.pinv(np.linalg.qr(jacobian[:, own], mode="r"), rcond=1e-9)
        at += width
    scaled = jacobian @ back
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    kept = values > _CANCELLED
    vectors, values = vectors[:, kept], values[kept]
    forth = np.linalg.pinv(back, rcond=1e-15)
    normal = forth.T @ ((vectors * values) @ vectors.T) @ forth
    return normal, forth.T @ (vectors @ (vectors.T @ (back.T @ gradient)))


def _solve(normal: F64, gradient: F64) -> F64:
    scale = _scale(normal)
    scaled = normal / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, gradient / scale) / scale)


def _scale(normal: F64) -> F64:
    """Size of each column; 1 where a parameter changes nothing."""
    size = np.sqrt(np.diag(normal))
    return np.asarray(np.where(size > 1e-100, size, 1.0))


def _robust(covariance: F64, scores: F64) -> F64:
    """Covariance by the model's noise, and by what is left where that is no noise.

    The second part is the sandwich estimate over blocks of samples (Huber 1967, White 1982): what
    is left of a model that is not quite right repeats itself for a while.
    """
    count = len(scores) // _BLOCK
    blocks = scores[: count * _BLOCK].reshape(count, _BLOCK, -1).sum(axis=1)
    return np.asarray(covariance + covariance @ (blocks.T @ blocks) @ covariance)


def _inverse(normal: F64) -> F64:
    scale = _scale(normal)
    scaled = normal / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
    return np.asarray(np.linalg.inv(scaled) / np.outer(scale, scale))
