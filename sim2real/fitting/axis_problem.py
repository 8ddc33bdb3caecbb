"""What a model of one axis is fitted to: tracked recordings, and the cost of what is left of them.

The cost is twice the negative log posterior: the sum of squares of the innovations over their
standard deviation (position) and of the force actual's deviations over theirs, plus the base
parameters' deviations over the machine file's tolerance, squared. The filter's gains are those of
one run, first of the nominal model, then of what was found: so all models are weighed alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import AxisSettings
from sim2real.fitting.axis_model import FINEST, NUISANCES, STEP, AxisModel
from sim2real.fitting.workers import Workers
from sim2real.recording import BoolArray
from sim2real.tracking import Gains, Track, Tracker

F64 = NDArray[np.float64]

_BASE_STEP = 0.01
"""Relative step of the base parameters for differences: wide enough for single slips to average."""
_UNLIKE, _UNLIKE_STEP = 0.5, 0.2
"""Standard deviation of how far a stage is from the simulator's steps, and its own step for
differences."""
_OUTLIER = 4.0
"""Deviations beyond so many sigma count less and less: breakaways are events, not findings."""
_SLOW = 8
"""Samples whose mean shows structure that a single one hides."""
_EVENTS = 0.03
"""Share of an axis' time that is left out of its structure."""
_WHITE = 0.55
"""Structure below this is none; nominal stages reach 0.5."""
_NEARLY_WHITE = 0.6
"""The same for what is left in the end, where a stage need not be stepped as the simulator is."""
_SIDE_BY_SIDE = 8
"""Models that are simulated side by side: more of them gain nothing."""
_FAR_FROM_WHITE = 3.0
"""Structure beside which it does not count how finely the stage is stepped."""
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
        falling: what the last iteration lowered the cost by, where another one was not made.
    """

    model: AxisModel
    cost: float
    residual: F64
    covariance: F64 | None
    falling: float = 0.0


class AxisProblem:
    """One axis of one or several recordings of the same stage.

    Args:
        trackers: of the axis, one per recording.
        tolerance: relative standard deviation of the base parameters.
        workers: that runs may be dealt to.
    """

    def __init__(
        self, trackers: Sequence[Tracker], tolerance: float, workers: Workers | None = None
    ) -> None:
        self.workers = workers or Workers()
        self.trackers = tuple(trackers)
        self.axis = trackers[0].axis
        self.spread: F64 = np.append(np.full(STEP, tolerance), _UNLIKE)
        self.start = AxisModel(np.zeros(NUISANCES))
        first = [tracker.run(self.axis) for tracker in trackers]
        self.gains: tuple[Gains, ...] = tuple(gains for _, gains in first)
        self.tracks: tuple[Track, ...] = tuple(track for track, _ in first)
        self.masks: tuple[BoolArray, ...] = tuple(track.valid for track in self.tracks)
        self.outlier = _OUTLIER

    def as_fine_as_needed(self, residual: F64) -> AxisProblem:
        """The same problem in the reference's steps, unless far more than their effect is left."""
        return self if structure(self.positions(residual)) > _FAR_FROM_WHITE else self.finer()

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
        return other

    def track(self, model: AxisModel) -> tuple[Track, ...]:
        """The recordings tracked under a model.

        Raises:
            ValueError: values that physics does not allow.
            Stopped: nobody waits for it any more.
        """
        settings = model.settings(self.axis)
        tracks = []
        for tracker, gains in zip(self.trackers, self.gains, strict=True):
            self.workers.check()
            tracks.append(tracker.run(settings, gains, model.fine)[0])
        return tuple(tracks)

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
            return self._largest()

    def _largest(self) -> F64:
        return np.full(2 * sum(int(mask.sum()) for mask in self.masks), _CUT)

    def residuals(self, models: Sequence[AxisModel]) -> list[F64 | None]:
        """Weighted deviations under several models, which takes each less time than by itself.

        Returns:
            float64[R] for each, None for values that physics does not allow.
        """
        return self.workers.spread(self._side_by_side, models, _SIDE_BY_SIDE)

    def _side_by_side(self, models: Sequence[AxisModel]) -> list[F64 | None]:
        self.workers.check()
        settings: dict[int, AxisSettings] = {}
        for i, model in enumerate(models):
            try:
                settings[i] = model.settings(self.axis)
            except ValueError:
                continue
        fines = [models[i].fine for i in settings]
        runs = [
            tracker.variants(list(settings.values()), gains, fines)
            for tracker, gains in zip(self.trackers, self.gains, strict=True)
        ]
        found: list[F64 | None] = [None] * len(models)
        for i, tracks in zip(settings, zip(*runs, strict=True), strict=True):
            possible = [track for track in tracks if track is not None]
            if len(possible) == len(tracks):
                found[i] = self.weighted(possible)
        return found

    def all_attempted(self, models: Sequence[AxisModel]) -> list[F64]:
        """As `attempted`, of several models as `residuals`."""
        return [self._largest() if r is None else r for r in self.residuals(models)]

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
        self.gains = tuple(tracker.run(settings, None, model.fine)[1] for tracker in self.trackers)

    def revalued(self, fitted: Fitted) -> Fitted:
        """The same model with residual and cost as gains and outliers count by now."""
        residual = self.residual(fitted.model)
        return replace(fitted, residual=residual, cost=self.cost(fitted.model, residual))

    def at_start(self) -> Fitted:
        """The nominal model as it is."""
        residual = self.weighted(self.tracks)
        return Fitted(self.start, self.cost(self.start, residual), residual, None)

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
        steps, models = [], []
        for j in range(NUISANCES):
            sides = (_BASE_STEP, -_BASE_STEP)
            if j == STEP:  # to one side: neither coarser than the simulator nor infinitely fine
                way = _UNLIKE_STEP if model.base[j] < 0.5 * FINEST else -_UNLIKE_STEP
                sides = (way, 2.0 * way)
            for step in sides:
                base = model.base.copy()
                base[j] += step
                steps.append(step)
                models.append(replace(model, base=base))
        slopes = [
            (there - residual) / step
            for there, step in zip(self.all_attempted(models), steps, strict=True)
        ]
        return np.column_stack(
            [agreed(one, other) for one, other in zip(slopes[::2], slopes[1::2], strict=True)]
        )


def agreed(one: F64, other: F64) -> F64:
    """Slope that steps to both sides agree on: the smaller one, 0 where their signs differ.

    A slip that comes a sample earlier on one side is an event, not a derivative.
    """
    smaller = np.where(np.abs(one) < np.abs(other), one, other)
    return np.asarray(np.where(one * other > 0.0, smaller, 0.0))


def structure(innovations: F64) -> float:
    """How far innovations are from white: energy of their slow part over what noise would have.

    About 1 for white noise of the size that the filter expects. The loudest few parts in a hundred
    are left out: breakaways that no model foretells.
    """
    count = len(innovations) // _SLOW
    blocks = innovations[: count * _SLOW].reshape(count, _SLOW)
    energy = np.sort(np.square(blocks.sum(axis=1))) / _SLOW
    return float(np.mean(energy[: max(1, round((1.0 - _EVENTS) * count))]))
