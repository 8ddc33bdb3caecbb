"""Ways to explain an axis, and what each is worth.

Two things count: what the innovations say (sharp, but blind to what the filter follows, as another
friction level), and the free closed-loop gap (blunt, but what people see).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sim2real.fitting import AxisModel, AxisProblem, Fitted, implausible, is_course, plausible

Loop = Callable[[AxisModel], float]
"""Squared closed-loop gap over floor of the axis under a model (`sim2real.closed_loop`)."""

_OCCAM = 20.0
"""Score that each parameter of an effect but the first must save: more than chance does."""
_OCCAM_COURSE = 6.0
"""The same for a Coulomb level that changes with time, against one that does not: in ten seconds
most warm-ups change little, and levels that stay are no likelier beforehand."""
_IMPLAUSIBLE = 40.0
"""Score for each tenth of its plausible range that a value lies beyond it."""
_COHERENT = 1000.0
"""Samples over which the closed loop's deviations repeat themselves, for their weight."""


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """One way to explain an axis.

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


def score(problem: AxisProblem, rival: Rival, each: float = _OCCAM) -> float:
    """What is to be least: the cost of the innovations and of the closed-loop gap.

    The latter counts as twice a negative log likelihood too, of as many samples as are on their
    own; both as outliers count by now. The simpler one wins where both fit: each parameter of an
    effect but the first has to save `each`, or what is asked of a course. So does the likelier
    one: values beyond what is plausible count against an effect.
    """
    samples = sum(int(mask.sum()) for mask in problem.masks)
    loop = samples / _COHERENT * rival.gap
    simpler = sum(
        (min(each, _OCCAM_COURSE) if is_course(term, problem.axis) else each)
        * (len(term.values) - 1)
        for term in rival.model.terms
    )
    far = _IMPLAUSIBLE * sum(implausible(term, problem.axis) for term in rival.model.terms)
    return problem.cost(rival.model, rival.fitted.residual) + loop + simpler + far


class Book:
    """Every set of effects that was fitted, the best fit of each.

    Args:
        problem: the axis.
        loop: its closed-loop gap under a model.
    """

    def __init__(self, problem: AxisProblem, loop: Loop) -> None:
        self._problem = problem
        self._loop = loop
        self._kept: dict[tuple[str, ...], Rival] = {}

    def entered(self, fitted: Fitted) -> Rival:
        """A fit, or what is likelier of it; kept where it is the best one of its set."""
        rival = self._likelier(Rival(fitted, self._loop(fitted.model)))
        key = tuple(sorted(fitted.model.names()))
        if key not in self._kept or self.score(rival) < self.score(self._kept[key]):
            self._kept[key] = rival
        return rival

    def _likelier(self, rival: Rival) -> Rival:
        """The fit, or with values no farther than plausible where that costs less than it brings.

        Where the data are silent a fit goes anywhere.
        """
        axis = self._problem.axis
        terms = tuple(plausible(term, axis) for term in rival.model.terms)
        if terms == rival.model.terms:
            return rival
        model = replace(rival.model, terms=terms)
        residual = self._problem.attempted(model)
        cost = self._problem.cost(model, residual)
        other = Rival(Fitted(model, cost, residual, None), self._loop(model))
        return min(rival, other, key=self.score)

    def score(self, rival: Rival) -> float:
        """As `score`, of this axis."""
        return score(self._problem, rival)

    def regained(self, model: AxisModel) -> Rival:
        """All sets again as the filter weighs them under a model that was entered; that one back.

        What shakes the stage makes friction less sure than the machine file's model has it.
        """
        self._problem.regain(model)
        for key, rival in self._kept.items():
            self._kept[key] = replace(rival, fitted=self._problem.revalued(rival.fitted))
        return self.best(model.names())

    def best(self, names: tuple[str, ...]) -> Rival:
        """The best fit of a set of effects that was entered."""
        return self._kept[tuple(sorted(names))]

    def ranked(self) -> list[Rival]:
        """The best fit of each set, best first."""
        return sorted(self._kept.values(), key=self.score)


def sets_of(rivals: Sequence[Rival], size: int) -> list[Rival]:
    """The rivals of so many effects, in their order."""
    return [rival for rival in rivals if len(rival.model.terms) == size]
