"""What a model of one axis is fitted to: tracked recordings, and the cost of what a model leaves.

The cost is twice the negative log posterior: innovations of the position and deviations of the
force actual, each over its standard deviation, in a Cauchy loss that limits outliers, plus the
squared deviations of the base parameters over the machine file's tolerance. The filter's gains are
those of a single run, first of the nominal model, later of what was found, so all models are
weighted alike.

`slow_energy` of the innovations is called structure here: what is left beyond white noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from hil_sim.settings import AxisSettings
from sim2real.fitting.axis_model import MAX_REFINEMENT, NUISANCES, STEP, AxisModel
from sim2real.fitting.workers import Workers
from sim2real.tracking import Gains, Track, Tracker
from stagedata import F64, BoolArray

_BASE_STEP = 0.01
"""Relative step of the base parameters for difference quotients: wide enough to average over single
slips."""
_REFINEMENT_SPREAD, _REFINEMENT_STEP = 0.5, 0.2
"""Standard deviation of the refinement of the integration steps; its step for differences."""
_OUTLIER = 4.0
"""Deviations beyond this many sigma lose weight: breakaways are events, not findings."""
_SLOW = 8
"""Samples that are averaged to show structure that single ones hide."""
_EVENTS = 0.03
"""Share of the blocks of samples, the largest, that does not count as structure: breakaways."""
_SEED = 1
_WHITE = 1.5
"""Largest `slow_energy` that counts as white, over that of the model's own run."""
_NEARLY_WHITE = 1.65
"""The same for the final model, since the stage may take other integration steps."""
_SIDE_BY_SIDE = 8
"""Models simulated at once: more gain nothing."""
_FAR_FROM_WHITE = 3.0
"""`slow_energy` beyond which finer integration steps cannot make the innovations white."""
_DIVERGED = 1e4
"""Deviations are clipped to this many sigma where a model makes the stage run away."""


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A model fitted to an axis.

    Attributes:
        model: at the minimum.
        cost: there: twice the negative log posterior, up to a constant.
        residual: weighted deviations there, float64[R].
        covariance: of base parameters and all effects' coordinates, in order; None where it was not
            asked for.
        last_gain: reduction of the cost by the last iteration, where the fit ended before it
            converged.
    """

    model: AxisModel
    cost: float
    residual: F64
    covariance: F64 | None = None
    last_gain: float = 0.0


class AxisProblem:
    """One axis of one or several recordings of the same stage.

    A residual holds weighted deviations: innovations of all valid samples over the standard
    deviations that the filter expects, positions then forces, float64[R].

    Args:
        trackers: of the axis, one per recording.
        tolerance: relative standard deviation of the base parameters.
        workers: threads that the simulations are shared among.

    Attributes:
        noise_energy: mean square of the position's innovations of a run of the model itself.
    """

    def __init__(
        self, trackers: Sequence[Tracker], tolerance: float, workers: Workers | None = None
    ) -> None:
        self.workers = workers or Workers()
        self.trackers = tuple(trackers)
        self.axis = trackers[0].axis
        self.spread: F64 = np.append(np.full(STEP, tolerance), _REFINEMENT_SPREAD)
        self.start = AxisModel(np.zeros(NUISANCES))
        first = [tracker.run(self.axis) for tracker in trackers]
        self.gains: tuple[Gains, ...] = tuple(gains for _, gains in first)
        self.tracks: tuple[Track, ...] = tuple(track for track, _ in first)
        self.masks: tuple[BoolArray, ...] = tuple(track.valid for track in self.tracks)
        self.outlier = _OUTLIER
        own = [tracker.of_own_run(_SEED).run(self.axis)[0] for tracker in trackers]
        alone = np.concatenate([track.position[track.valid] for track in own])
        self._noise, self.noise_energy = slow_energy(alone), float(np.mean(np.square(alone)))

    def finer_if_close(self, residual: F64) -> AxisProblem:
        """The problem in the reference's steps, or this one if those could not make it white."""
        return self if slow_energy(self.positions(residual)) > _FAR_FROM_WHITE else self.finer()

    def finer(self) -> AxisProblem:
        """The same problem, simulated in the reference's steps."""
        other = copy(self)
        other.trackers = tuple(tracker.finer() for tracker in self.trackers)
        return other

    def set_other_axes(self, others: Sequence[AxisSettings]) -> None:
        """Take the other axes as these from now on, for effects that depend on them."""
        self.trackers = tuple(tracker.with_other_axes(others) for tracker in self.trackers)

    def masked(self, masks: Sequence[BoolArray]) -> AxisProblem:
        """The same problem restricted to some of the valid samples."""
        other = copy(self)
        other.masks = tuple(
            track.valid & mask for track, mask in zip(self.tracks, masks, strict=True)
        )
        return other

    def track(self, model: AxisModel) -> tuple[Track, ...]:
        """The recordings tracked under a model.

        Raises:
            ValueError: values that physics does not allow.
            Stopped: the result is no longer wanted.
        """
        settings = model.settings(self.axis)
        tracks = []
        for tracker, gains in zip(self.trackers, self.gains, strict=True):
            self.workers.check()
            tracks.append(tracker.run(settings, gains, model.substeps)[0])
        return tuple(tracks)

    def weighted(self, tracks: Sequence[Track]) -> F64:
        """Weighted deviations of tracked recordings, positions then forces, float64[R]."""
        parts = [t.position[m] for t, m in zip(tracks, self.masks, strict=True)]
        parts += [t.force[m] for t, m in zip(tracks, self.masks, strict=True)]
        return np.clip(np.nan_to_num(np.concatenate(parts), nan=_DIVERGED), -_DIVERGED, _DIVERGED)

    def residual(self, model: AxisModel) -> F64:
        """Weighted deviations under a model, float64[R].

        Raises:
            ValueError: values that physics does not allow.
        """
        return self.weighted(self.track(model))

    def residuals(self, models: Sequence[AxisModel]) -> list[F64 | None]:
        """Weighted deviations under several models, simulated at once.

        Returns:
            float64[R] for each, None for values that physics does not allow.
        """
        return self.workers.spread(self._side_by_side, models, _SIDE_BY_SIDE)

    def _side_by_side(self, models: Sequence[AxisModel]) -> list[F64]:
        self.workers.check()
        settings = [model.settings(self.axis) for model in models]
        stage_substeps = [model.substeps for model in models]
        runs = [
            tracker.variants(settings, gains, stage_substeps)
            for tracker, gains in zip(self.trackers, self.gains, strict=True)
        ]
        return [self.weighted(tracks) for tracks in zip(*runs, strict=True)]

    def residuals_or_worst(self, models: Sequence[AxisModel]) -> list[F64]:
        """As `residuals`; the largest ones where physics does not allow a model."""
        worst = np.full(2 * sum(int(mask.sum()) for mask in self.masks), _DIVERGED)
        return [worst if residual is None else residual for residual in self.residuals(models)]

    def cost(self, model: AxisModel, residual: F64) -> float:
        """Twice the negative log posterior."""
        loss = self.outlier**2 * np.log1p(np.square(residual / self.outlier)).sum()
        return float(loss) + float(np.square(model.base / self.spread).sum())

    def expected_cost(self) -> float:
        """Cost of a model that leaves nothing but noise."""
        samples = 2 * sum(int(mask.sum()) for mask in self.masks)
        nodes, weights = np.polynomial.hermite_e.hermegauss(40)
        loss = self.outlier**2 * np.log1p(np.square(nodes / self.outlier))
        return float(samples * (weights @ loss) / weights.sum())

    def weights(self, residual: F64) -> F64:
        """Weights that give least squares the gradient of the cost, float64[R]."""
        return np.asarray(1.0 / (1.0 + np.square(residual / self.outlier)))

    def rescale(self, residual: F64) -> None:
        """Set the limit of outliers to a few times the rms of these deviations, float64[R]."""
        usual = float(np.sqrt(np.mean(np.square(np.clip(residual, -20.0, 20.0)))))
        self.outlier = _OUTLIER * max(1.0, usual)

    def retune(self, model: AxisModel) -> None:
        """Take the filter's gains from a run of this model: all costs change."""
        settings = model.settings(self.axis)
        self.gains = tuple(
            tracker.run(settings, None, model.substeps)[1] for tracker in self.trackers
        )

    def unfitted(self, model: AxisModel) -> Fitted:
        """A model as it is; with the largest deviations where physics does not allow it."""
        (residual,) = self.residuals_or_worst([model])
        return Fitted(model, self.cost(model, residual), residual)

    def reweighted(self, fitted: Fitted) -> Fitted:
        """The same model with residual and cost under the present gains and outliers."""
        residual = self.residual(fitted.model)
        return replace(fitted, residual=residual, cost=self.cost(fitted.model, residual))

    def nominal_fit(self) -> Fitted:
        """The nominal model, unfitted."""
        residual = self.weighted(self.tracks)
        return Fitted(self.start, self.cost(self.start, residual), residual)

    def is_white(self, residual: F64) -> bool:
        """Whether what is left looks like noise."""
        return slow_energy(self.positions(residual)) < _WHITE * self._noise

    def is_nearly_white(self, residual: F64) -> bool:
        """Whether what is left is no more than another integration step may leave."""
        return slow_energy(self.positions(residual)) < _NEARLY_WHITE * self._noise

    def positions(self, residual: F64) -> F64:
        """The positions' part of weighted deviations."""
        return residual[: sum(int(m.sum()) for m in self.masks)]

    def base_columns(self, model: AxisModel, residual: F64) -> F64:
        """Derivatives of the residual by the nuisance parameters, float64[R, NUISANCES]."""
        steps, models = [], []
        for j in range(NUISANCES):
            sides = (_BASE_STEP, -_BASE_STEP)
            if j == STEP:  # to one side: neither coarser than the simulator nor infinitely fine
                way = (
                    _REFINEMENT_STEP if model.base[j] < 0.5 * MAX_REFINEMENT else -_REFINEMENT_STEP
                )
                sides = (way, 2.0 * way)
            for step in sides:
                base = model.base.copy()
                base[j] += step
                steps.append(step)
                models.append(replace(model, base=base))
        slopes = [
            (there - residual) / step
            for there, step in zip(self.residuals_or_worst(models), steps, strict=True)
        ]
        return np.column_stack(
            [
                agreeing_slope(one, other)
                for one, other in zip(slopes[::2], slopes[1::2], strict=True)
            ]
        )


def agreeing_slope(one: F64, other: F64) -> F64:
    """The slope that steps to both sides agree on: the smaller, 0 where their signs differ.

    An element that slips a sample earlier on one side is an event, not a derivative.
    """
    smaller = np.where(np.abs(one) < np.abs(other), one, other)
    return np.asarray(np.where(one * other > 0.0, smaller, 0.0))


def slow_energy(innovations: F64) -> float:
    """How far innovations are from white: energy of their slow part over that of noise.

    About 0.8 for white noise of the size that the filter expects, as the largest 3 % of the blocks
    are left out: breakaways that no model predicts.
    """
    count = len(innovations) // _SLOW
    blocks = innovations[: count * _SLOW].reshape(count, _SLOW)
    energy = np.sort(np.square(blocks.sum(axis=1))) / _SLOW
    return float(np.mean(energy[: max(1, round((1.0 - _EVENTS) * count))]))
