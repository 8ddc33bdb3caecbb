"""What a search found, judged by the free closed-loop gap that people see.

The search works on one-step predictions. Where the library holds what the stage has, nothing is
left of them, and the closed loop agrees. Where it does not, effects may be called in that help
the predictions and hurt the loop: there the set that closes most of the gap is taken, an effect
more only if it closes much of what is left, and none if none closes enough.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from hil_sim.settings import StageSettings
from sim2real.attribution.alternatives import sets_of
from sim2real.attribution.search import AxisSearch
from sim2real.fitting import AxisModel, AxisProblem, Fitted, fit
from sim2real.gap import Measured
from sim2real.shrinkage import SIGNALS, axis_gap

_CLOSES = 0.4
"""Share of the gap, or of what is left of it, that an effect must close where structure is left."""
_VISIBLE = 0.25
"""Rise of the squared gap over floor that an effect's removal must bring."""
_SETS = 4
"""Sets of effects that are simulated."""


def gate(
    searches: Mapping[str, AxisSearch], measured: Sequence[Measured], settings: StageSettings
) -> None:
    """Take back effects that do nothing for the closed-loop gap; searches are changed in place."""
    models = {name: found.best.model for name, found in searches.items()}
    for name, found in searches.items():
        if not found.best.model.terms:
            continue
        best = (
            _visible(name, models, measured, settings)
            if found.whole
            else _closing(name, found, models, measured, settings)
        )
        alone = partial(_alone, name, models, measured, settings)
        same = best.names() == found.best.model.names()
        if not same or alone(best) < alone(found.best.model):
            problem = found.problem
            if best.terms:
                problem = problem.as_fine_as_needed(problem.residual(best))
            found.best = _settled(problem, best, alone)
        models[name] = found.best.model
        before = axis_gap(name, {**models, name: found.problem.start}, measured, settings)
        after = _gap(name, found, models, measured, settings)
        if before > SIGNALS + _VISIBLE:
            found.closes = 1.0 - (after - SIGNALS) / (before - SIGNALS)


def _alone(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
    model: AxisModel,
) -> float:
    """Gap of an axis under another model of it, the other axes as they are."""
    return axis_gap(name, {**models, name: model}, measured, settings)


def _settled(problem: AxisProblem, model: AxisModel, gap: Callable[[AxisModel], float]) -> Fitted:
    """The model fitted once more; as it is, where that would open its gap again.

    An effect in a shape that is not quite the stage's is bent by innovations it cannot take up.
    """
    again = fit(problem, model, 3)
    return again if gap(again.model) <= gap(model) else fit(problem, model, 0)


def _visible(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> AxisModel:
    """Without the effects that nobody would see."""
    model = models[name]
    gap = axis_gap(name, models, measured, settings)
    for index in reversed(range(len(model.terms))):
        fewer = {**models, name: model.without(index)}
        if axis_gap(name, fewer, measured, settings) - gap < _VISIBLE:
            model = model.without(index)
    return model


def _gap(
    name: str,
    found: AxisSearch,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> float:
    """Gap of an axis; of an effect in another shape, what its kind closes in that shape."""
    gap = axis_gap(name, models, measured, settings)
    names = models[name].names()
    if len(names) == 1 and names[0] in found.repeats and found.repeats[names[0]].departs:
        return min(gap, found.repeats[names[0]].gap)
    return gap


def _closing(
    name: str,
    found: AxisSearch,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> AxisModel:
    """The set that closes most of the gap, no larger than it has to be."""
    best = found.problem.start
    least = axis_gap(name, {**models, name: best}, measured, settings)
    for size in (1, 2):
        sets = [r.model for r in sets_of(found.rivals, size)][:_SETS]
        gaps = [_gap(name, found, {**models, name: m}, measured, settings) for m in sets]
        if not gaps:
            continue
        lowest = min(gaps)
        left = max(least - SIGNALS, 0.0)
        if least - lowest > max(_VISIBLE, _CLOSES * left):
            best, least = sets[gaps.index(lowest)], lowest
    return best
