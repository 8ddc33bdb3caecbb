"""Which effects act on an axis: forward selection, with each step reconsidered.

Every effect of the library is scanned, the most promising ones are fitted beside what was found
before, and the best one is kept if the recording supports it. Each effect found is then tested
again: would another do as well in its place? Alternatives with similar scores are kept for the
probabilities and for the list of effects that these recordings cannot tell apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from hil_sim.effects import Effect
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import Alternative, LoopGap, Ranking
from sim2real.attribution.axis_search import AxisSearch
from sim2real.attribution.candidates import TrackedDictionary
from sim2real.attribution.levels import Levels, is_wander, settle_levels
from sim2real.dictionary import Candidate, shift_only_place
from sim2real.fitting import (
    STEP,
    AxisModel,
    AxisProblem,
    Fitted,
    Term,
    coordinates,
    fit,
    is_within_tolerance,
)
from sim2real.held_out import FLOOR_LEVEL
from sim2real.scoring.constants import (
    CLOSE,
    FACTOR,
    FAINT,
    FEWEST_SCALED,
    FITTED,
    FITTED_FAINT,
    LEAST_GAIN,
    MASS,
    MOST_EFFECTS,
    NEAR,
    OFFSET,
    OPEN,
    PASSES,
    PROMISING,
    RIVALS,
    SCALED,
    TEMPER,
    WANDERS,
    WIDE,
    WITHIN,
)
from stagedata import F64

_SHIFT, _PERIOD = 0.1, 1e-3
"""Distance over which a constant force is compared [m]; any period will do for that [s]."""


def search_effects(
    problem: AxisProblem,
    library: Mapping[str, Effect],
    loop: LoopGap,
    progress: Callable[[float], object] = lambda _: None,
    is_hopeless: Callable[[Sequence[AxisModel]], bool] = lambda _: False,
    find_first: Callable[[], AxisModel | None] = lambda: None,
) -> AxisSearch:
    """Find the effects of an axis.

    Effects are added one by one, then each is tested again beside those that came later. Where that
    changes the set, more may be found beside the new one.

    Args:
        problem: the axis.
        library: effects to consider.
        loop: closed-loop gap of the axis under a model.
        progress: called with the share done.
        is_hopeless: whether none of these models, of two effects or more, is on the right way.
        find_first: an effect beside which all else is small; asked for where the gap is too wide
            for scans to first order.
    """
    columns = problem.base_columns(problem.start, problem.residual(problem.start))
    plain = fit(problem, problem.start, 2, columns, thorough=False)
    plain = fit(problem, plain.model, 3, thorough=False)
    open_gap = loop(problem.start)
    ranking = Ranking(problem, loop)
    selection = _Selection(problem, library, ranking, progress, is_hopeless)
    last, steps = ranking.enter(plain), dict[str, _Step]()
    first = find_first() if open_gap > WIDE * FLOOR_LEVEL else None
    if first is not None:
        started = ranking.refine(ranking.fit([first], 5))
        last = started if ranking.score(started) < ranking.score(last) else last
    # What does not show in the closed loop is no gap, whatever the innovations say, nor is what the
    # machine file's figures explain within their tolerance.
    is_gap = open_gap > OPEN * FLOOR_LEVEL and not _is_tolerance(problem, last)
    for _ in range(PASSES if is_gap else 0):
        last, added = selection.look_forward(last)
        last = selection.look_for_constant(last)
        steps |= {step.name: step for step in added}
        effects = last.model.names()
        if not added or len(effects) == 1:
            break
        last = selection.look_back(last, steps)
        problem.rescale(last.fitted.residual)
        last = selection.look_for_factor(last)
        problem.rescale(last.fitted.residual)
        if set(last.model.names()) == set(effects):
            break
        last = ranking.reweigh(last.model)
        problem.rescale(last.fitted.residual)
    fine = problem.finer_if_close(last.fitted.residual)
    best = fit(fine, last.model, 2) if last.model.terms else last.fitted
    nothing = not last.model.terms and last.gap < OPEN * FLOOR_LEVEL
    is_complete, levels = nothing or problem.is_nearly_white(best.residual), Levels(best)
    if is_complete:
        levels = settle_levels(fine, best, library, loop)
        for alternative in levels.fitted:
            ranking.keep(alternative)
        is_complete = nothing or is_wander(fine, levels.best.model)
    return AxisSearch(
        axis=problem.axis,
        spread=problem.spread,
        problem=problem,
        plain=plain,
        best=levels.best,
        open_gap=open_gap,
        is_complete=is_complete,
        alternatives=ranking.ranked(),
        levels=levels.odds,
        scanned=selection.scanned,
    )


def _is_tolerance(problem: AxisProblem, plain: Alternative) -> bool:
    """Whether figures within their tolerance explain an axis."""
    is_near = plain.gap < NEAR and _are_figures_within(problem, plain)
    return is_near and problem.is_white(plain.fitted.residual)


def _are_figures_within(problem: AxisProblem, found: Alternative) -> bool:
    """Whether the plant's figures are within their tolerance: else they stand in for an effect."""
    return bool(np.abs(found.model.base[:STEP] / problem.spread[:STEP]).max() < WITHIN)


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """One more effect, and what was fitted in its place.

    Attributes:
        best: the explanation from then on; its last effect is the new one.
        trials: explanations that each add one effect to those before, `best` among them.
    """

    best: Alternative
    trials: tuple[Alternative, ...]

    @property
    def name(self) -> str:
        """The effect that was added."""
        return self.best.model.names()[-1]


class _Selection:
    """Forward selection on an axis, and what its scans show.

    Args:
        problem: the axis.
        library: effects to consider.
        ranking: of all that is fitted.
        progress: called with the share done.
        is_hopeless: as of `search_effects`.

    Attributes:
        scanned: effect -> its best candidate in the first scan.
    """

    def __init__(
        self,
        problem: AxisProblem,
        library: Mapping[str, Effect],
        ranking: Ranking,
        progress: Callable[[float], object],
        is_hopeless: Callable[[Sequence[AxisModel]], bool],
    ) -> None:
        self._is_hopeless = is_hopeless
        self._problem = problem
        self._library = library
        self._ranking = ranking
        self._progress = progress
        self.scanned: dict[str, Candidate] = {}

    def look_forward(self, start: Alternative) -> tuple[Alternative, list[_Step]]:
        """Add one effect after another to `start`, as long as the recording supports it.

        Returns the explanation reached, and the steps to it.
        """
        problem, ranking = self._problem, self._ranking
        steps: list[_Step] = []
        last = start
        for depth in range(len(start.model.terms), MOST_EFFECTS):
            # Beside an effect, base parameters fitted without it are distorted: from nominal.
            current = last.fitted if depth else problem.nominal_fit()
            problem.rescale(current.residual)
            is_open = last.gap > OPEN * FLOOR_LEVEL
            candidates, columns = self._candidates(current, is_open, depth)
            if not candidates:
                break
            beside = [current.model.added(candidate.term) for candidate in candidates]
            trials = ranking.fit(beside, 5, columns)
            best = ranking.refine(trials)
            last = ranking.best(last.model.names())
            if ranking.score(last) - ranking.score(best) < CLOSE:
                last = ranking.enter(fit(problem, last.model, 4, thorough=False))
            if self._saved(last, best) < LEAST_GAIN:
                break
            if is_within_tolerance(best.model.terms[-1], problem.axis, float(problem.spread[0])):
                break
            if not self._leads_somewhere(last, best, depth):
                break
            steps.append(_Step(best, tuple(trials)))
            last = best
            self._progress((depth + 1) / MOST_EFFECTS)
            problem.rescale(best.fitted.residual)
            is_done = best.gap < OPEN * FLOOR_LEVEL and _are_figures_within(problem, best)
            if is_done and problem.is_white(best.fitted.residual):
                break
            if depth and self._is_hopeless([a.model for a in ranking.ranked()[:FITTED]]):
                break
        last = ranking.best(last.model.names())
        problem.rescale(last.fitted.residual)
        return last, steps

    def _candidates(
        self, current: Fitted, is_open: bool, depth: int
    ) -> tuple[list[Candidate], F64]:
        """Starts of the most promising effects, and derivatives by the base parameters.

        The scan takes the first four tenths of the search for one more effect.
        """
        problem = self._problem
        columns = problem.base_columns(current.model, current.residual)
        dictionary = TrackedDictionary(problem, current, columns)
        others = {n: e for n, e in self._library.items() if n not in current.model.names()}
        done = count(1)

        def scan(effect: Effect) -> list[Candidate]:
            best = [*dictionary.best(effect, 2), *dictionary.follow(effect)]
            self._progress((depth + 0.4 * next(done) / len(others)) / MOST_EFFECTS)
            return sorted(best, key=lambda start: -start.gain)

        scanned = problem.workers.map(scan, others.values())
        if depth == 0:
            self.scanned |= {n: tried[0] for n, tried in zip(others, scanned, strict=True) if tried}
        starts = sorted((s for tried in scanned for s in tried), key=lambda start: -start.gain)
        needed = FAINT if is_open else LEAST_GAIN
        if not starts or starts[0].gain < needed:
            return [], columns
        least = max(needed, PROMISING * starts[0].gain)
        most = FITTED_FAINT if starts[0].gain < 10.0 * LEAST_GAIN else FITTED
        chosen = [start for start in starts[:most] if start.gain >= least]
        if is_open:  # wander weighs little beside innovations, whatever it does to the loop
            wanders = [s for s in starts if s.from_wander and s.gain >= needed and s not in chosen]
            chosen += wanders[:WANDERS]
        return chosen, columns

    def _saved(self, before: Alternative, after: Alternative) -> float:
        """Score that a step saves: figures beyond their tolerance count as effects do (`TEMPER`).

        A factor on the force that moves mass and friction five tolerances each leaves innovations
        as good as figures so far off do.
        """
        tolerance = self._problem.spread[:STEP]
        beyond = [float(np.square(a.model.base[:STEP] / tolerance).sum()) for a in (before, after)]
        saved = self._ranking.score(before) - self._ranking.score(after)
        return saved + (TEMPER - 1.0) * (beyond[0] - beyond[1])

    def _leads_somewhere(self, before: Alternative, after: Alternative, depth: int) -> bool:
        """Whether a step may be one of several that explain the axis.

        Where up to n more effects act, the largest of them removes at least 1/n of what is left. If
        no effect of the library does, what acts is not in the library.
        """
        score, share = self._ranking.score, 1.0 / (MOST_EFFECTS - depth)
        open_score = score(before) - self._problem.expected_cost()
        gained = score(before) - score(after)
        closed = before.gap - after.gap
        return gained > share * open_score or closed > share * (before.gap - FLOOR_LEVEL)

    def look_back(self, current: Alternative, steps: Mapping[str, _Step]) -> Alternative:
        """Test each effect again beside the others: without it, and with its rivals.

        Also the last one: it may have done no more than to move a fit on that had stalled without
        it.
        """
        problem, ranking = self._problem, self._ranking
        for name in current.model.names():
            index = current.model.names().index(name)
            fewer = without_effect(current.model, index, problem.axis)
            ranking.enter(fit(problem, fewer, 4, thorough=False))
            rest = ranking.best(fewer.names())
            if self._saved(rest, current) < LEAST_GAIN:
                current = rest
                continue
            rivals = self._rivals(steps[name], current) if name in steps else []
            beside = [rest.model.added(t) for t in rivals if t.name not in rest.model.names()]
            if beside:
                current = ranking.refine([current, *ranking.fit(beside, 3)])
        return current

    def look_for_constant(self, current: Alternative) -> Alternative:
        """A constant force in the place of a spring from beyond the travel, if that scores better.

        Fits may end before they reach a large force; that of the spring shows its size.
        """
        start = constant_instead(current.model, self._problem.axis, self._library)
        if start is None:
            return current
        return self._ranking.refine([current, *self._ranking.fit([start], 5)])

    def look_for_factor(self, current: Alternative) -> Alternative:
        """A factor on the force in the place of mass, friction and stiffness, if that takes less.

        By itself such a factor is the same as all of these by its inverse, and a mass the same as a
        factor beside the rest of them. No exchange of one effect for another leads from one to the
        other.
        """
        ranking = self._ranking
        start = factor_instead(current.model, self._problem.axis, self._library)
        if start is None or len(current.model.terms) - len(start.terms) < FEWEST_SCALED - 1:
            return current
        last, _ = self.look_forward(ranking.refine(ranking.fit([start], 5)))
        last, current = ranking.reweigh(last.model), ranking.best(current.model.names())
        fewer = len(current.model.terms) - len(last.model.terms)
        worse = ranking.score(last) - ranking.score(current)
        return last if worse < fewer * LEAST_GAIN else current

    def _rivals(self, step: _Step, current: Alternative) -> list[Term]:
        """What may have lost to a step's effect only because later effects were still missing.

        That is what was behind by less than these have saved since.
        """
        score, best = self._ranking.score, self._ranking.best
        least = 2.0 * score(best(step.best.model.names())) - score(current)
        behind = sorted((best(trial.model.names()) for trial in step.trials), key=score)
        terms = {a.model.terms[-1].name: a.model.terms[-1] for a in behind if score(a) < least}
        return [term for name, term in terms.items() if name != step.name][:RIVALS]


def constant_instead(
    model: AxisModel, axis: AxisSettings, library: Mapping[str, Effect]
) -> AxisModel | None:
    """A start with a constant force in the place of a spring that is centered beyond the travel.

    None where the model has no such spring, or a constant force already.
    """
    low, high = axis.travel
    for index, term in enumerate(model.terms):
        at = shift_only_place(term.effect)
        if at is not None and not low <= term.values[at] <= high:
            rest = model.without(index)
            force = _constant_force(model, axis) - _constant_force(rest, axis)
            if OFFSET in library and OFFSET not in rest.names():
                return rest.added(Term(library[OFFSET], (force,)))
    return None


def factor_instead(
    model: AxisModel, axis: AxisSettings, library: Mapping[str, Effect]
) -> AxisModel | None:
    """A start with a factor on the force in the place of a mass, and of what else it scales.

    Or a mass in the place of a factor and of what that does not scale. None where the model has
    neither, or both.
    """
    terms = {term.name: term for term in model.terms}
    if FACTOR not in library or MASS not in library or (FACTOR in terms) == (MASS in terms):
        return None
    if MASS in terms:
        other = Term(library[FACTOR], (axis.mass / (axis.mass + terms[MASS].values[0]),))
    else:
        other = Term(library[MASS], (axis.mass / terms[FACTOR].values[0] - axis.mass,))
    kept = tuple(term for term in model.terms if term.name not in (*SCALED, FACTOR))
    return AxisModel(np.zeros_like(model.base), (*kept, other))


def without_effect(model: AxisModel, index: int, axis: AxisSettings) -> AxisModel:
    """The model with one effect fewer; a spring's center takes over what was a constant force.

    A spring and a constant force are a spring elsewhere, too far away for a fit that takes steps.
    """
    fewer = model.without(index)
    missing = _constant_force(model, axis) - _constant_force(fewer, axis)
    for i, term in enumerate(fewer.terms):
        at = shift_only_place(term.effect)
        if at is None or not missing:
            continue
        key = term.effect.parameters[at].key
        moved = fewer.with_value(i, key, term.values[at] + _SHIFT)
        slope = (_constant_force(moved, axis) - _constant_force(fewer, axis)) / _SHIFT
        entry = coordinates(term.effect, axis)[at]
        if slope:
            return fewer.with_value(i, key, entry.clipped(term.values[at] + missing / slope))
    return fewer


def _constant_force(model: AxisModel, axis: AxisSettings) -> float:
    """What a model's effects take at rest in the middle of the travel [N]."""
    ports = EffectPorts.filled(model.settings(axis), _PERIOD, _PERIOD)
    return ports.force + ports.spring * sum(axis.travel) / 2.0
