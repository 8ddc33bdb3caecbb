"""Which effects act on an axis: forward selection, with each step reconsidered.

Every effect of the library is scanned, the most promising ones are fitted beside what was found
before, and the best one is kept if the recording supports it. Each effect found is then tested
again: would another do as well in its place? Alternatives with similar scores are kept for the
probabilities and for the list of effects that these recordings cannot tell apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import Alternative, LoopGap, Ranking
from sim2real.attribution.levels import is_wander, settle_levels
from sim2real.attribution.refinement import (
    fit_alternatives,
    refine_contenders,
    without_effect,
)
from sim2real.attribution.shape_check import Repeat
from sim2real.attribution.tracked import TrackedDictionary
from sim2real.dictionary import Candidate
from sim2real.fitting import AxisModel, AxisProblem, Fitted, Term, fit, is_within_tolerance
from sim2real.free_loop import (
    FreeFit,
    FreeLoop,
    FreeSearch,
    fit_figures,
    move_covariance,
)
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
    OPEN,
    PASSES,
    PROMISING,
    RIVALS,
    SCALED,
    WANDERS,
)
from sim2real.shrinkage import FLOOR_LEVEL

F64 = NDArray[np.float64]


@dataclass(slots=True, eq=False)
class AxisSearch:
    """The result of the search on one axis.

    Attributes:
        problem: that was searched.
        plain: base parameters alone.
        best: the effects found, fitted; equal to `plain` where there are none.
        open_gap: squared closed-loop gap over floor of the machine file on this axis.
        is_complete: whether `best` leaves nothing but noise, or there was nothing to explain.
        closes: share of the axis' free-run gap that `best` closes (`closed_loop_check`).
        repeats: effect found -> fit with the same effect a second time (`shape_check`).
        alternatives: sets of effects that were fitted, without duplicates, best first.
        scanned: effect -> first-order gain in the first scan.
        signatures: effect -> signature in the first scan (`dictionary.Candidate`).
        levels: effect on the Coulomb level -> others that could take its place -> odds.
        free: the search in the free loop, where that took over.
        folds: models fitted to all moves but a fold's, where the free loop gave the figures.
    """

    problem: AxisProblem
    plain: Fitted
    best: Fitted
    open_gap: float = 0.0
    is_complete: bool = True
    closes: float = 0.0
    repeats: dict[str, Repeat] = field(default_factory=dict)
    alternatives: list[Alternative] = field(default_factory=list)
    scanned: dict[str, float] = field(default_factory=dict)
    signatures: dict[str, F64] = field(default_factory=dict)
    levels: dict[str, dict[str, float]] = field(default_factory=dict)
    free: FreeSearch | None = None
    folds: list[AxisModel] = field(default_factory=list)

    def decide_in_loop(self, free: FreeSearch) -> None:
        """Take what the free loop names on an axis that innovations leave open: effects, or none.

        Where innovations confirm them by nothing but noise being left, the figures are theirs: they
        know them several times better.
        """
        self.free, self.repeats = free, {}
        if not free.names_causes():
            self.best = self.plain
            return
        self._take_figures(free.loop, free.best, free.folds)
        problem = self.problem
        problem.retune(self.best.model)
        again = fit(problem, self.best.model, 4, thorough=False)
        problem.rescale(again.residual)
        confirmed = fit(problem.finer_if_close(again.residual), again.model, 2)
        white = problem.is_nearly_white(confirmed.residual)
        self.is_complete = white and is_wander(problem, confirmed.model)
        if self.is_complete:
            self.best, self.folds = confirmed, []

    def fit_in_loop(self, loop: FreeLoop, model: AxisModel) -> None:
        """Take effects with figures fitted in the free loop, as where structure is left.

        Innovations that a model cannot explain distort its figures. Values that cannot be simulated
        stay as they are.
        """
        if not loop.allows(model):
            return
        self._take_figures(loop, *fit_figures(loop, model))

    def _take_figures(self, loop: FreeLoop, fitted: FreeFit, folds: Sequence[FreeFit]) -> None:
        residual = self.problem.residual_or_worst(fitted.model)
        cost = self.problem.cost(fitted.model, residual)
        self.best = Fitted(fitted.model, cost, residual, move_covariance(loop, fitted))
        self.folds = [fold.model for fold in folds]

    def fold_models(self) -> list[AxisModel]:
        """See `sim2real.shrinkage.held_out.FittedAxis`: those of the free loop, where it ran."""
        return self.folds

    def discard(self, names: tuple[str, ...]) -> None:
        """Discard a set of effects, as if it had never been considered."""
        self.is_complete = False
        self.alternatives = [r for r in self.alternatives if set(r.model.names()) != set(names)]

    def prefer(self, model: AxisModel, gap: float) -> None:
        """Rank a model before all alternatives."""
        residual = self.problem.residual_or_worst(model)
        cost = self.problem.cost(model, residual)
        self.alternatives.insert(0, Alternative(Fitted(model, cost, residual, None), gap))


def search_effects(
    problem: AxisProblem,
    library: Mapping[str, Effect],
    loop: LoopGap,
    progress: Callable[[float], object] = lambda _: None,
) -> AxisSearch:
    """Find the effects of an axis.

    Effects are added one by one, then each is tested again beside those that came later. Where that
    changes the set, more may be found beside the new one.

    Args:
        problem: the axis.
        library: effects to consider.
        loop: closed-loop gap of the axis under a model.
        progress: called with the share done.
    """
    columns = problem.base_columns(problem.start, problem.residual(problem.start))
    plain = fit(problem, problem.start, 2, columns, thorough=False)
    plain = fit(problem, plain.model, 3, thorough=False)
    found = AxisSearch(problem, plain, plain, loop(problem.start))
    ranking = Ranking(problem, loop)
    last, steps = ranking.enter(plain), dict[str, _Step]()
    # What does not show in the closed loop is no gap, whatever the innovations say.
    for _ in range(PASSES if found.open_gap > OPEN * FLOOR_LEVEL else 0):
        last, added = _look_forward(problem, library, ranking, last, found, progress)
        steps |= {step.name: step for step in added}
        effects = last.model.names()
        if not added or len(effects) == 1:
            break
        last = _look_back(problem, last, steps, ranking)
        problem.rescale(last.fitted.residual)
        last = _look_for_factor(problem, library, ranking, last, found, progress)
        problem.rescale(last.fitted.residual)
        if set(last.model.names()) == set(effects):
            break
        last = ranking.reweigh(last.model)
        problem.rescale(last.fitted.residual)
    model = last.model
    fine = problem.finer_if_close(last.fitted.residual)
    found.best = fit(fine, model, 2) if model.terms else last.fitted
    nothing = not model.terms and last.gap < OPEN * FLOOR_LEVEL
    found.is_complete = nothing or problem.is_nearly_white(found.best.residual)
    if found.is_complete:
        levels = settle_levels(fine, found.best, library, loop)
        found.best, found.levels = levels.best, levels.odds
        for alternative in levels.fitted:
            ranking.keep(alternative)
        found.is_complete = nothing or is_wander(fine, found.best.model)
    found.alternatives = ranking.ranked()
    return found


def refit_beside(found: AxisSearch, others: Sequence[AxisSettings]) -> None:
    """Refit an axis whose effects depend on other axes, beside these.

    Each axis was searched on its own, with the others as the machine file says.

    Args:
        found: changed in place.
        others: all axes with what was found on them.
    """
    problem, model = found.problem, found.best.model
    problem.set_other_axes(others)
    problem.retune(model)
    again = fit(problem, model, 4, thorough=False)
    problem.rescale(again.residual)
    found.best = fit(problem.finer_if_close(again.residual), again.model, 2)
    white = problem.is_nearly_white(found.best.residual)
    found.is_complete = white and is_wander(problem, found.best.model)
    own = set(model.names())
    found.alternatives = [
        replace(r, fitted=again if set(r.model.names()) == own else problem.reweighted(r.fitted))
        for r in found.alternatives
    ]


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


def _look_forward(
    problem: AxisProblem,
    library: Mapping[str, Effect],
    ranking: Ranking,
    start: Alternative,
    found: AxisSearch,
    progress: Callable[[float], object],
) -> tuple[Alternative, list[_Step]]:
    """Add one effect after another to `start`, as long as the recording supports it.

    Returns the explanation reached, and the steps to it.
    """
    steps: list[_Step] = []
    last = start
    for depth in range(len(start.model.terms), MOST_EFFECTS):
        # Fitted to a stage with an effect, the base parameters are distorted: start from nominal.
        current = last.fitted if depth else problem.nominal_fit()
        problem.rescale(current.residual)
        is_open = last.gap > OPEN * FLOOR_LEVEL
        scanned = partial(_advance, progress, depth)
        candidates, columns = _candidates(
            problem, current, library, is_open, found if depth == 0 else None, scanned
        )
        if not candidates:
            break
        beside = [current.model.added(start.term) for start in candidates]
        trials = fit_alternatives(problem, ranking, beside, 5, columns)
        best = refine_contenders(problem, ranking, trials)
        last = ranking.best(last.model.names())
        if ranking.score(last) - ranking.score(best) < CLOSE:
            last = ranking.enter(fit(problem, last.model, 4, thorough=False))
        if ranking.score(last) - ranking.score(best) < LEAST_GAIN:
            break
        if is_within_tolerance(best.model.terms[-1], problem.axis, float(problem.spread[0])):
            break
        if not _leads_somewhere(problem, ranking, last, best, depth):
            break
        steps.append(_Step(best, tuple(trials)))
        last = best
        progress((depth + 1) / MOST_EFFECTS)
        problem.rescale(best.fitted.residual)
        if problem.is_white(best.fitted.residual) and best.gap < OPEN * FLOOR_LEVEL:
            break
    last = ranking.best(last.model.names())
    problem.rescale(last.fitted.residual)
    return last, steps


def _advance(progress: Callable[[float], object], depth: int, scanned: float) -> None:
    """The scan takes the first four tenths of the search for one more effect."""
    progress((depth + 0.4 * scanned) / MOST_EFFECTS)


def _candidates(
    problem: AxisProblem,
    current: Fitted,
    library: Mapping[str, Effect],
    is_open: bool,
    found: AxisSearch | None = None,
    progress: Callable[[float], object] = lambda _: None,
) -> tuple[list[Candidate], F64]:
    """Starts of the most promising effects, and derivatives by the base parameters.

    `found` records the results of the scan. `progress` is called with the share of the effects
    scanned, from any thread.
    """
    columns = problem.base_columns(current.model, current.residual)
    dictionary = TrackedDictionary(problem, current, columns)
    others = {n: effect for n, effect in library.items() if n not in current.model.names()}
    done = count(1)

    def scan(effect: Effect) -> list[Candidate]:
        best = [*dictionary.best(effect, 2), *dictionary.follow(effect)]
        progress(next(done) / len(others))
        return sorted(best, key=lambda start: -start.gain)

    scanned = problem.workers.map(scan, others.values())
    starts: list[Candidate] = []
    for name, tried in zip(others, scanned, strict=True):
        starts += tried
        if found is not None and tried:
            found.scanned[name] = tried[0].gain
            found.signatures[name] = tried[0].signature
    starts.sort(key=lambda start: -start.gain)
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


def _leads_somewhere(
    problem: AxisProblem, ranking: Ranking, before: Alternative, after: Alternative, depth: int
) -> bool:
    """Whether a step may be one of several that explain the axis.

    Where up to n more effects act, the largest of them removes at least 1/n of what is left. If no
    effect of the library does, what acts is not in the library.
    """
    share = 1.0 / (MOST_EFFECTS - depth)
    open_score = ranking.score(before) - problem.expected_cost()
    gained = ranking.score(before) - ranking.score(after)
    closed = before.gap - after.gap
    return gained > share * open_score or closed > share * (before.gap - FLOOR_LEVEL)


def _look_back(
    problem: AxisProblem,
    current: Alternative,
    steps: Mapping[str, _Step],
    ranking: Ranking,
) -> Alternative:
    """Test each effect again beside the others: without it, and with its rivals.

    Also the last one: it may have done no more than to move a fit on that had stalled without it.
    """
    for name in current.model.names():
        index = current.model.names().index(name)
        fewer = without_effect(current.model, index, problem.axis)
        ranking.enter(fit(problem, fewer, 4, thorough=False))
        rest = ranking.best(fewer.names())
        if ranking.score(current) > ranking.score(rest) - LEAST_GAIN:
            current = rest
            continue
        rivals = _rivals(ranking, steps[name], current) if name in steps else []
        beside = [rest.model.added(term) for term in rivals if term.name not in rest.model.names()]
        if beside:
            trials = fit_alternatives(problem, ranking, beside, 3)
            current = refine_contenders(problem, ranking, [current, *trials])
    return current


def _look_for_factor(
    problem: AxisProblem,
    library: Mapping[str, Effect],
    ranking: Ranking,
    current: Alternative,
    found: AxisSearch,
    progress: Callable[[float], object],
) -> Alternative:
    """A factor on the force in the place of mass, friction and stiffness, if that takes less.

    By itself such a factor is the same as all of these by its inverse. Selection takes the mass
    first, and no exchange of one effect for another leads back.
    """
    terms = {term.name: term for term in current.model.terms}
    scaled = {name for name in SCALED if name in terms}
    if FACTOR in terms or FACTOR not in library:
        return current
    if MASS not in scaled or len(scaled) < FEWEST_SCALED:
        return current
    mass = problem.axis.mass
    factor = Term(library[FACTOR], (mass / (mass + terms[MASS].values[0]),))
    kept = tuple(term for term in current.model.terms if term.name not in scaled)
    start = AxisModel(problem.start.base, (*kept, factor))
    last = refine_contenders(problem, ranking, fit_alternatives(problem, ranking, [start], 5))
    last, _ = _look_forward(problem, library, ranking, last, found, progress)
    last, current = ranking.reweigh(last.model), ranking.best(current.model.names())
    fewer = len(current.model.terms) - len(last.model.terms)
    worse = ranking.score(last) - ranking.score(current)
    return last if worse < fewer * LEAST_GAIN else current


def _rivals(ranking: Ranking, step: _Step, current: Alternative) -> list[Term]:
    """What may have lost to a step's effect only because later effects were still missing.

    That is what was behind by less than these have saved since.
    """
    least = 2.0 * ranking.score(ranking.best(step.best.model.names())) - ranking.score(current)
    behind = sorted((ranking.best(t.model.names()) for t in step.trials), key=ranking.score)
    terms = {r.model.terms[-1].name: r.model.terms[-1] for r in behind if ranking.score(r) < least}
    return [term for name, term in terms.items() if name != step.name][:RIVALS]
