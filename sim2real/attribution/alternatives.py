"""Alternative explanations of an axis, and their scores.

Two things count: the innovations (sharp, but insensitive to what the filter follows, such as
another friction level) and the free-run gap (less sharp, but what users see).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sim2real.fitting import AxisModel, AxisProblem, Fitted, clip_to_plausible, fit
from sim2real.scoring import effects_penalty
from sim2real.scoring.constants import (
    CLOSE,
    CLOSE_SHARE,
    COHERENT,
    CONTENDERS,
    LEAST_GAIN,
    LEAST_PROGRESS,
    OUTLIER_SHRINKAGE,
    ROUNDS,
    SHORT,
    TEMPER,
)
from stagedata import F64

LoopGap = Callable[[AxisModel], float]
"""Squared closed-loop gap over floor of the axis under a model (`sim2real.held_out.axis_gap`)."""


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """One explanation of an axis.

    Attributes:
        fitted: the fit.
        gap: its squared closed-loop gap over floor.
    """

    fitted: Fitted
    gap: float

    @property
    def model(self) -> AxisModel:
        """The model that was fitted."""
        return self.fitted.model


def score_alternative(problem: AxisProblem, alternative: Alternative) -> float:
    """Score of an explanation, to be minimised: cost of the innovations and of the closed-loop gap.

    Both parts are twice a negative log likelihood; that of the gap counts one sample in `COHERENT`,
    as the others are correlated. To this comes what its effects have to save.

    Args:
        problem: the axis.
        alternative: the explanation.
    """
    model = alternative.model
    samples = sum(int(mask.sum()) for mask in problem.masks)
    loop = samples / COHERENT * alternative.gap
    cost = problem.cost(model, alternative.fitted.residual)
    return cost + loop + TEMPER * effects_penalty(model, problem.axis)


class Ranking:
    """Every set of effects that was fitted, with the best fit of each.

    Args:
        problem: the axis.
        loop: its closed-loop gap under a model.
    """

    def __init__(self, problem: AxisProblem, loop: LoopGap) -> None:
        self._problem = problem
        self._loop = loop
        self._kept: dict[tuple[str, ...], Alternative] = {}

    def enter(self, fitted: Fitted) -> Alternative:
        """Enter a fit, or a more plausible version; kept if it is the best of its effects."""
        alternative = self._more_plausible(Alternative(fitted, self._loop(fitted.model)))
        self.keep(alternative)
        return alternative

    def keep(self, alternative: Alternative) -> None:
        """Keep an alternative if it is the best of its effects."""
        key = tuple(sorted(alternative.model.names()))
        if key not in self._kept or self.score(alternative) < self.score(self._kept[key]):
            self._kept[key] = alternative

    def _more_plausible(self, alternative: Alternative) -> Alternative:
        """The fit, or the same with its values clipped to plausible ones if that scores better.

        A parameter that the data do not determine may end anywhere in a fit.
        """
        axis = self._problem.axis
        terms = tuple(clip_to_plausible(term, axis) for term in alternative.model.terms)
        if terms == alternative.model.terms:
            return alternative
        model = replace(alternative.model, terms=terms)
        other = Alternative(self._problem.unfitted(model), self._loop(model))
        return min(alternative, other, key=self.score)

    def score(self, alternative: Alternative) -> float:
        """As `score_alternative`, of this axis."""
        return score_alternative(self._problem, alternative)

    def reweigh(self, model: AxisModel) -> Alternative:
        """Retune the filter to a model that was entered, and weigh all sets anew; returns that one.

        What excites the stage beyond the machine file's model makes friction less certain than the
        filter assumes until then.
        """
        self._problem.retune(model)
        for key, alternative in self._kept.items():
            self._kept[key] = replace(
                alternative, fitted=self._problem.reweighted(alternative.fitted)
            )
        return self.best(model.names())

    def best(self, names: tuple[str, ...]) -> Alternative:
        """The best fit of a set of effects that was entered."""
        return self._kept[tuple(sorted(names))]

    def ranked(self) -> list[Alternative]:
        """The best fit of each set, best first."""
        return sorted(self._kept.values(), key=self.score)

    def fit(
        self, models: Sequence[AxisModel], iterations: int, columns: F64 | None = None
    ) -> list[Alternative]:
        """Fit several models at once, with common derivatives by the base parameters if given."""

        def one(model: AxisModel) -> Fitted:
            return fit(self._problem, model, iterations, columns, thorough=False)

        return [self.enter(fitted) for fitted in self._problem.workers.map(one, models)]

    def refine(self, trials: Sequence[Alternative]) -> Alternative:
        """The best of the trials, after all that come close have been fitted to convergence.

        The first fits stop early and use the filter gains of the model without the effect, so their
        scores do not yet tell which effect is better.
        """
        problem = self._problem
        self.reweigh(min(trials, key=self.score).model)
        names = {tuple(sorted(trial.model.names())) for trial in trials}

        def ranked() -> list[Alternative]:
            return sorted((self.best(each) for each in names), key=self.score)[:CONTENDERS]

        for _ in range(ROUNDS):
            order = ranked()
            before, wide = self.score(order[0]), problem.outlier
            excess = max(before - problem.expected_cost(), 0.0)
            last = before + max(CLOSE, CLOSE_SHARE * before, excess)
            # And those that would come close if their cost kept falling at its last rate.
            near = [a for a in order if self._next_score(a) <= last]
            # The derivatives by base parameters hardly depend on which effect is beside them.
            columns = problem.base_columns(near[0].model, near[0].fitted.residual)
            self.fit([a.model for a in near], SHORT, columns)
            best, *others = ranked()
            gained = before - self.score(best)
            overtaken = any(self._next_score(a) < self.score(best) for a in others)
            problem.rescale(best.fitted.residual)
            if (
                gained < max(LEAST_GAIN, LEAST_PROGRESS * excess)
                and problem.outlier > OUTLIER_SHRINKAGE * wide
                and not overtaken
            ):
                break
        return best

    def _next_score(self, alternative: Alternative) -> float:
        """Score after another fit, if the cost keeps falling at its last rate."""
        return self.score(alternative) - SHORT * alternative.fitted.last_gain


def of_size(alternatives: Sequence[Alternative], size: int) -> list[Alternative]:
    """The alternatives with this many effects, in their order."""
    return [alternative for alternative in alternatives if len(alternative.model.terms) == size]
