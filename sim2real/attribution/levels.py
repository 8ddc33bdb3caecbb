"""Which effect changes the level of Coulomb friction, by the wander that it leaves.

Innovations hardly tell such effects apart, because the filter follows the level whatever changes
it. But with the right effect in the model, the filter has no more left to follow than the wander of
the machine file's `repeatability`. So each effect is weighed by its evidence: the probability of
the tracked level, averaged over the plausible values of the effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hil_sim.effects import Effect
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import Alternative
from sim2real.attribution.signature import effect_inputs
from sim2real.dictionary import FIRST_ORDER, Values, effect_nodes
from sim2real.fitting import AxisModel, AxisProblem, Fitted, Term, fit, implausibility
from sim2real.fitting import is_coulomb_level as is_level
from sim2real.scoring.constants import ALIKE, IMPLAUSIBLE, LEVEL_MISFIT
from sim2real.tracking import Track
from stagedata import F64

_SLIDING = 0.02
"""Velocity from which the level shows [m/s]: at rest the filter forgets it."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a tracked Coulomb level says for or against an effect.

    Attributes:
        value: natural logarithm of the probability of the level, up to a common constant.
        spread: 1 sigma of its size, as a share of the plausible range.
        term: the effect with the values that come nearest to the level.
    """

    value: float
    spread: float
    term: Term


@dataclass(slots=True, eq=False)
class Levels:
    """What was decided between effects on the Coulomb level.

    Attributes:
        best: the model with the most probable ones.
        odds: effect in it -> effect that could take its place -> odds, at most 1.
        fitted: models in which one is swapped for another that could take its place.
    """

    best: Fitted
    odds: dict[str, dict[str, float]] = field(default_factory=dict)
    fitted: list[Alternative] = field(default_factory=list)


def settle_levels(
    problem: AxisProblem,
    best: Fitted,
    library: Mapping[str, Effect],
    loop: Callable[[AxisModel], float],
) -> Levels:
    """Decide which effects on the Coulomb level a model should have.

    Args:
        problem: the axis.
        best: a model that leaves nothing else.
        library: effects by name.
        loop: squared closed-loop gap of the axis under a model.
    """
    levels = Levels(best)
    if problem.axis.wander <= 0.0:
        return levels
    levels.best = _merge(problem, best, library)
    for index, term in enumerate(levels.best.model.terms):
        if not is_level(term, problem.axis):
            continue
        others = [e for n, e in library.items() if n not in levels.best.model.names()]
        weighed = weigh_levels(problem, levels.best.model, [index], [term.effect, *others])
        tried = {term.name: levels.best}
        for name, evidence in weighed.items():
            if name != term.name and evidence.value > weighed[term.name].value + math.log(ALIKE):
                swapped = _swap(problem, levels.best.model, [index], evidence.term)
                if problem.is_nearly_white(swapped.residual):
                    tried[name] = swapped
        likely = max(tried, key=lambda name: weighed[name].value)
        levels.best = tried[likely]
        levels.odds[likely] = {
            name: math.exp(weighed[name].value - weighed[likely].value)
            for name in tried
            if name != likely
        }
        levels.fitted += [Alternative(each, loop(each.model)) for each in tried.values()]
    return levels


def is_wander(problem: AxisProblem, model: AxisModel) -> bool:
    """Whether the level tracked beside a model is no more than the wander of `repeatability`.

    If it is more, the level has a course that the model lacks, although the filter follows it and
    the innovations do not show it.
    """
    tracks = problem.track(model)
    level = np.concatenate([track.level[np.abs(track.v) > _SLIDING] for track in tracks])
    if problem.axis.wander <= 0.0 or not len(level):
        return True
    return float(np.mean(level**2)) < LEVEL_MISFIT * problem.axis.wander**2


def _merge(problem: AxisProblem, best: Fitted, library: Mapping[str, Effect]) -> Fitted:
    """The model with one effect on the level where several are less probable."""
    model = best.model
    at = [i for i, term in enumerate(model.terms) if is_level(term, problem.axis)]
    if len(at) < 2:
        return best
    own = [weigh_levels(problem, model, [i], [model.terms[i].effect]) for i in at]
    each = [evidence for weighed in own for evidence in weighed.values()]
    if len(each) < len(at):
        return best
    together = each[0].value + sum(math.log(evidence.spread) for evidence in each[1:])
    kept = {term.name for i, term in enumerate(model.terms) if i not in at}
    singles = [effect for name, effect in library.items() if name not in kept]
    alone = weigh_levels(problem, model, at, singles).values()
    likely = max(alone, key=lambda evidence: evidence.value, default=None)
    if likely is None or likely.value < together:
        return best
    merged = _swap(problem, model, at, likely.term)
    return merged if problem.is_nearly_white(merged.residual) else best


def weigh_levels(
    problem: AxisProblem, model: AxisModel, at: Sequence[int], effects: Sequence[Effect]
) -> dict[str, Evidence]:
    """Evidence of effects in the place of some of a model, by the level tracked beside these.

    Args:
        problem: the axis.
        model: with the effects.
        at: indices of those in it, which change the Coulomb level and nothing else.
        effects: that may take their place; those that do anything else are left out.
    """
    without = tuple(term for i, term in enumerate(model.terms) if i not in at)
    axis = replace(model, terms=without).settings(problem.axis)
    tracks = problem.track(model)
    period = float(problem.trackers[0].time[1])
    times = [(tracker.time, tracker.start) for tracker in problem.trackers]
    accelerations = [np.gradient(track.v, period) for track in tracks]
    motion = list(zip(tracks, times, accelerations, strict=True))
    total = 1.0 + np.concatenate([track.level for track in tracks])
    for index in at:
        course = level_course(axis, model.terms[index], motion)
        if course is None:
            return {}
        total = total * (1.0 + course)
    sliding = np.concatenate([np.abs(track.v) > _SLIDING for track in tracks])
    level = total[sliding] - 1.0
    travelled = min(float(t.x.min()) for t in tracks), max(float(t.x.max()) for t in tracks)
    # Energy of one independent sample of the wander, which is correlated in time.
    unit = 2.0 * problem.axis.correlation_time / period * problem.axis.wander**2
    evidence = {}
    for effect in effects:
        nodes = effect_nodes(effect, problem.axis, travelled, FIRST_ORDER, lambda *_: None)
        courses = ((v, level_course(axis, Term(effect, v), motion)) for v in nodes)
        each = [
            _evidence(problem.axis, effect, values, course[sliding], level, unit)
            for values, course in courses
            if course is not None and course[sliding].any()
        ]
        if each:
            mean = float(np.logaddexp.reduce([e.value for e in each])) - math.log(len(each))
            evidence[effect.name] = replace(max(each, key=lambda e: e.value), value=mean)
    return evidence


def level_course(
    axis: AxisSettings, term: Term, motion: Sequence[tuple[Track, tuple[F64, float], F64]]
) -> F64 | None:
    """Relative change of the Coulomb level by a term that changes nothing else, float64[K].

    Args:
        axis: without the term.
        term: to be added.
        motion: of each recording its track, times with its start [s], accelerations [m/s^2].
    """
    parts = []
    for track, (time, start), acceleration in motion:
        there = effect_inputs(axis, term, track, time, acceleration, start)
        if there is None or there.level is None or there.force is not None:
            return None
        parts.append(there.level)
    return np.concatenate(parts)


def _evidence(
    axis: AxisSettings, effect: Effect, values: Values, course: F64, level: F64, unit: float
) -> Evidence:
    """Evidence of an effect of any size: sizes are equally probable over the plausible range."""
    at = next(i for i, p in enumerate(effect.parameters) if p.role == "size")
    parameter = effect.parameters[at]
    first = values[at] - (parameter.neutral_on(axis) or 0.0)
    along, square = float(course @ level), float(course @ course)
    size = values[at] - first + along / square * first
    term = Term(effect, (*values[:at], size, *values[at + 1 :]))
    left = (float(level @ level) - along**2 / square) / unit
    width = sum(high - low for low, high in parameter.ranges(axis))
    spread = abs(first) * math.sqrt(unit / square) / width
    beyond = IMPLAUSIBLE * implausibility(term, axis)
    return Evidence(-0.5 * (left + beyond) + math.log(spread), spread, term)


def _swap(problem: AxisProblem, model: AxisModel, at: Sequence[int], term: Term) -> Fitted:
    """The model with another effect in the place of some, fitted."""
    rest = [each for i, each in enumerate(model.terms) if i not in at]
    terms = (*rest[: at[0]], term, *rest[at[0] :])
    first = fit(problem, replace(model, terms=terms), 4, thorough=False)
    return fit(problem.finer_if_close(first.residual), first.model, 2)
