"""The result of a search on one axis, and the steps that a diagnosis takes from it to the next.

The search works on one-step predictions. What it found is checked against the free-run gap that
users see, refitted beside what other axes have, or handed over to the free loop. A step leaves its
search as it is and returns another one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.attribution.alternatives import Alternative, LoopGap, score_alternative
from sim2real.attribution.levels import is_wander
from sim2real.dictionary import Candidate
from sim2real.findings import Unlisted
from sim2real.fitting import STEP, AxisModel, AxisProblem, Fitted, Term, fit
from sim2real.free_loop import FreeLoop, FreeSearch, move_covariance
from sim2real.gap import Measured
from sim2real.held_out import FLOOR_LEVEL, axis_gap
from sim2real.scoring import weigh_effect
from sim2real.scoring.constants import (
    ENOUGH,
    LEAST_GAIN,
    SCATTER,
    SURE,
    TEMPER,
    VISIBLE,
)
from stagedata import F64


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AxisResult:
    """What a search found on one axis, as conclusions are drawn from it.

    Attributes:
        axis: of the machine file.
        spread: relative standard deviations of its base parameters, float64[STEP] or more.
        best: the effects found, fitted.
        open_gap: squared gap over floor of the machine file on this axis.
        is_complete: whether `best` leaves nothing but noise, or there was nothing to explain.
        alternatives: sets of effects that were fitted, without duplicates, best first.
        levels: effect on the Coulomb level -> others that could take its place -> odds.
        free: the search in the free loop, where that took over.
        folds: models fitted to all moves but a fold's, where the free loop gave the figures.
        scanned: effect -> its best candidate in the first scan.
        scatter: of figures over stages, over what the covariance gives.
        unlisted: coordinates that a force depends on which no effect of the library has.
        doubted: effects that are not needed beside a curve over that coordinate.
    """

    axis: AxisSettings
    spread: F64
    best: Fitted
    open_gap: float = 0.0
    is_complete: bool = True
    alternatives: Sequence[Alternative] = ()
    levels: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    free: FreeSearch | None = None
    folds: Sequence[AxisModel] = ()
    scanned: Mapping[str, Candidate] = field(default_factory=dict)
    scatter: float = 1.0
    unlisted: Sequence[Unlisted] = ()
    doubted: Sequence[str] = ()

    def probability(self, effect: str) -> tuple[float, list[str]]:
        """Probability that an effect is present, and the effects that could take its place."""
        return (0.0, []) if self.free is None else self.free.probability(effect)

    def is_needed(self, _: Term) -> bool:
        """Whether an effect is present even if its size is uncertain."""
        return False

    def covariance(self) -> F64:
        """Of base parameters in sigmas, then of effects' coordinates, float64[P, P].

        Raises:
            ValueError: the fit has none.
        """
        if self.best.covariance is None:
            raise ValueError(f"axis {self.axis.name}: a thorough fit has a covariance")
        return self.best.covariance


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AxisSearch(AxisResult):
    """The result of the search on innovations.

    Attributes:
        problem: that was searched.
        plain: base parameters alone; `best` where there are no effects.
        closes: share of the axis' free-run gap that `best` closes.
    """

    problem: AxisProblem
    plain: Fitted
    closes: float = 0.0
    scatter: float = SCATTER

    def probability(self, effect: str) -> tuple[float, list[str]]:
        """See `AxisResult.probability`: by the free loop where it took over, else by all scores.

        Scores of innovations count a fifth (`TEMPER`). Between effects on the Coulomb level the
        odds are those that `settle_levels` gave.
        """
        if self.free is not None:
            return self.free.probability(effect)
        names = self.best.model.names()
        scores = {
            tuple(sorted(a.model.names())): score_alternative(self.problem, a) / TEMPER
            for a in reversed(self.alternatives)
        }
        own = scores.setdefault(tuple(sorted(names)), min(scores.values(), default=0.0))
        for other, odds in self.levels.get(effect, {}).items():
            swapped = tuple(sorted({*names, other} - {effect}))
            scores[swapped] = own - 2.0 * math.log(odds) if odds > 0.0 else math.inf
        probability, others = weigh_effect(scores, names, effect)
        # Nearly certain where nothing is left, else as far as the gap closes.
        return probability * (SURE if self.closes > ENOUGH else max(self.closes, 0.0)), others

    def is_needed(self, term: Term) -> bool:
        """Whether the model is complete with an effect and scores clearly worse without it.

        Such an effect is present even if its size is uncertain: of a bell beyond the end of the
        travel only the flank is seen, which bells of many heights share.
        """
        rest = {name for name in self.best.model.names() if name != term.name}
        score = {
            frozenset(a.model.names()): score_alternative(self.problem, a)
            for a in self.alternatives
        }
        own, without = score.get(frozenset({*rest, term.name})), score.get(frozenset(rest))
        if not self.is_complete or own is None or without is None:
            return False
        return without - own > LEAST_GAIN

    def covariance(self) -> F64:
        """As of `AxisResult`, float64[P, P], without the integration step: no machine file has it.

        Raises:
            ValueError: the fit has none.
        """
        found = self.best.covariance
        if found is None:  # without effects none was asked for until now
            found = fit(self.problem, self.best.model, 0).covariance
        if found is None:
            raise ValueError(f"axis {self.axis.name}: a thorough fit has a covariance")
        if self.folds:  # as the free loop has it
            return found
        own = np.delete(np.arange(len(found)), STEP)
        scale = np.ones(len(own))
        scale[:STEP] = self.spread[:STEP]
        return np.asarray(found[np.ix_(own, own)] / np.outer(scale, scale))

    def decided_in_loop(self, free: FreeSearch) -> AxisSearch:
        """What the free loop names on an axis that innovations leave open: effects, or none.

        Where innovations confirm them by nothing but noise being left, the figures are theirs: they
        know them several times better.
        """
        search = replace(self, free=free)
        if not free.names_causes():
            return replace(search, best=self.plain)
        best, folds = self._figures(free.loop, free.best, free.folds)
        _, confirmed, is_complete = _converge(self.problem, best.model)
        if is_complete:
            best, folds = confirmed, []
        return replace(search, best=best, folds=folds, is_complete=is_complete)

    def without_names(self, unlisted: Sequence[Unlisted]) -> AxisSearch:
        """The search where a coordinate is the answer, or nothing: no effect of the library."""
        return replace(
            self, best=self.plain, free=None, folds=(), is_complete=False, unlisted=unlisted
        )

    def _figures(
        self, loop: FreeLoop, fitted: Fitted, folds: Sequence[Fitted]
    ) -> tuple[Fitted, list[AxisModel]]:
        """What the free loop fitted, to all moves and to all but a fold's."""
        best = self.problem.unfitted(fitted.model)
        covariance = move_covariance(loop, fitted)
        return replace(best, covariance=covariance), [fold.model for fold in folds]

    def with_start(self, model: AxisModel, loop: LoopGap) -> AxisSearch:
        """The search with effects that it has not come upon, where these score better.

        Args:
            model: of them, to start from.
            loop: the closed-loop gap of the axis under a model.
        """
        problem = self.problem
        _, best, is_complete = _converge(problem, model)
        ranked = [
            Alternative(best, loop(best.model)),
            *(replace(a, fitted=problem.reweighted(a.fitted)) for a in self.alternatives),
        ]
        ranked.sort(key=lambda a: score_alternative(problem, a))
        if ranked[0].fitted is not best:
            problem.retune(self.best.model)
            return self
        return replace(self, best=best, is_complete=is_complete, alternatives=ranked)

    def refitted_beside(self, others: Sequence[AxisSettings]) -> AxisSearch:
        """The search with its effects refitted beside these other axes.

        Each axis was searched on its own, with the others as the machine file says.
        """
        problem, names = self.problem, set(self.best.model.names())
        problem.set_other_axes(others)
        again, best, is_complete = _converge(problem, self.best.model)
        alternatives = [
            replace(
                a, fitted=again if set(a.model.names()) == names else problem.reweighted(a.fitted)
            )
            for a in self.alternatives
        ]
        return replace(self, best=best, is_complete=is_complete, alternatives=alternatives)


def _converge(problem: AxisProblem, model: AxisModel) -> tuple[Fitted, Fitted, bool]:
    """A model fitted with gains of its own: at first, in the stage's steps, and if it is complete.

    The problem keeps the gains, and the limit of outliers.
    """
    problem.retune(model)
    first = fit(problem, model, 4, thorough=False)
    problem.rescale(first.residual)
    best = fit(problem.finer_if_close(first.residual), first.model, 2)
    return first, best, problem.is_nearly_white(best.residual) and is_wander(problem, best.model)


def drop_invisible(
    searches: Mapping[str, AxisSearch], measured: Sequence[Measured], settings: StageSettings
) -> dict[str, AxisSearch]:
    """The searches without effects whose removal hardly widens the free-run gap (`VISIBLE`).

    Axes that are not complete are left to the free loop.

    Args:
        searches: axis -> its search.
        measured: recordings.
        settings: of the machine file.
    """
    models = {name: search.best.model for name, search in searches.items()}
    visible = dict(searches)
    for name, search in searches.items():
        if not search.is_complete or not models[name].terms:
            continue
        gap = axis_gap(name, models, measured, settings)
        model = models[name]
        for index in reversed(range(len(model.terms))):
            fewer = {**models, name: model.without(index)}
            if axis_gap(name, fewer, measured, settings) - gap < VISIBLE:
                model = model.without(index)
        if model.names() != models[name].names():
            best = fit(search.problem.finer_if_close(search.best.residual), model, 3)
            visible[name], models[name] = replace(search, best=best), best.model
    return visible


def measure_closed(
    searches: Mapping[str, AxisSearch], measured: Sequence[Measured], settings: StageSettings
) -> dict[str, AxisSearch]:
    """The searches with the share of each axis' gap that its model closes.

    Arguments as `drop_invisible`.
    """
    models = {name: search.best.model for name, search in searches.items()}
    closed = dict(searches)
    for name, search in searches.items():
        before = axis_gap(name, {**models, name: search.problem.start}, measured, settings)
        after = axis_gap(name, models, measured, settings)
        if before > FLOOR_LEVEL + VISIBLE:
            share = 1.0 - (after - FLOOR_LEVEL) / (before - FLOOR_LEVEL)
            closed[name] = replace(search, closes=share)
    return closed
