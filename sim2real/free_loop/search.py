"""Which effects act on an axis, by the free loop: greedy selection with a look back.

Every effect of the library is tried beside what was found; the best ones are fitted, and the best
of those is kept where it pays: by its score on all moves, and on moves that took no part in its
fit. After each step every earlier effect has to show that it is still needed, and that no other
would do better in its place.

Source: docs/decisions/0014-free-loop.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import stdtrit

from hil_sim.effects import Effect
from sim2real.dictionary import Candidate, typical
from sim2real.fitting import AxisModel, Fitted, implausibility
from sim2real.free_loop.candidates import FreeDictionary
from sim2real.free_loop.fit import fit_free
from sim2real.free_loop.loop import FreeLoop
from sim2real.held_out import FLOOR_LEVEL, FOLDS
from sim2real.scoring import effects_penalty, weigh_effect
from sim2real.scoring.constants import (
    CHANCE,
    CLOSED,
    FITTED,
    FLIPS,
    HOPELESS,
    LONG,
    MOST_EFFECTS,
    NEAR,
    PATIENCE,
    REMEMBERED,
    RIVALS,
    SHORT,
    STRANGE,
    SURE,
    VISIBLE,
)
from stagedata import F64, BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of the selection (in a report: `sim2real.findings.SelectionStep`).

    Attributes:
        effects: names of all effects from then on.
        added: effects that the step added, mostly one.
        closed: share of the axis' gap that they close on held-out moves.
        uncertainty: of what the step adds to that share, one standard deviation over moves.
        model: the effects fitted to all moves.
    """

    effects: tuple[str, ...]
    added: tuple[str, ...]
    closed: float
    uncertainty: float
    model: AxisModel


@dataclass(slots=True, eq=False)
class FreeSearch:
    """The result of the search on one axis.

    Attributes:
        loop: the axis.
        best: the effects found, fitted to all moves.
        folds: the same effects fitted to all moves but a fold's, for each fold.
        open_gap: squared gap over floor of the machine file.
        steps: of the selection.
        scores: names of a set of effects that was fitted -> its score.
        of_rest: what it closes is a share of what a curve leaves, that is known beside the effects.
    """

    loop: FreeLoop
    best: Fitted
    folds: list[Fitted]
    open_gap: float
    steps: list[Step] = field(default_factory=list)
    scores: dict[tuple[str, ...], float] = field(default_factory=dict)
    of_rest: bool = False

    @property
    def closed(self) -> float:
        """Share of the axis' gap closed on held-out moves."""
        return self.steps[-1].closed if self.steps else 0.0

    def names_causes(self) -> bool:
        """Whether the effects found may be given as causes.

        They close most of the gap, and their values are plausible.
        """
        terms = self.best.model.terms
        return self.closed >= CLOSED and all(
            implausibility(term, self.loop.axis) <= STRANGE for term in terms
        )

    def is_near_floor(self) -> bool:
        """Whether next to nothing is left."""
        return self.loop.gap(self.best.residual) <= NEAR * FLOOR_LEVEL

    def probability(self, effect: str) -> tuple[float, list[str]]:
        """Probability that an effect is present, and the effects that could take its place.

        What is left may be part of any effect: no probability exceeds the share of the gap closed.
        """
        probability, others = weigh_effect(self.scores, self.best.model.names(), effect)
        return min(self.closed, probability, SURE), others


def score(loop: FreeLoop, fitted: Fitted) -> float:
    """Score of a model that was fitted to all moves, to be minimised.

    It is the cost of the fit plus what its effects have to save.
    """
    return fitted.cost + effects_penalty(fitted.model, loop.axis)


def search_free(
    loop: FreeLoop,
    library: Mapping[str, Effect],
    progress: Callable[[float], object] = lambda _: None,
    rival: AxisModel | None = None,
    *,
    most: int = MOST_EFFECTS,
    is_beaten: Callable[[AxisModel, AxisModel], bool] = lambda *_: False,
) -> FreeSearch:
    """Find the effects of an axis.

    Args:
        loop: the axis.
        library: effects to consider.
        progress: called with the share done.
        rival: effects found otherwise; these are the result where they score better.
        most: effects sought.
        is_beaten: whether something else explains what a model (the first one) leaves, better than
            the effect does that was added to it (the second one). Then the search ends.
    """
    selection = _Selection(loop, library)
    current = selection.fit(loop.start, SHORT)
    folds = [fit_free(loop, loop.start, SHORT, train) for train in _training(loop)]
    opened = loop.gap(loop.residual(loop.start))
    search = FreeSearch(loop, current, folds, opened, scores=selection.scores)
    plain = held = loop.held_out([fold.residual for fold in folds])

    def is_taken(model: AxisModel) -> bool:
        return bool(search.steps) and is_beaten(search.best.model, model)

    while len(current.model.terms) < most:
        new = selection.add_best(current)
        if new is None or score(loop, new) >= score(loop, current):
            break
        current = selection.look_back(new)
        folds = fit_folds(loop, current.model, folds)
        remaining = loop.held_out([fold.residual for fold in folds])
        names, before = current.model.names(), search.best.model.names()
        progress(len(names) / most)
        if _fall(loop, held, remaining)[0] < VISIBLE or not is_certain(held - remaining):
            if len(names) - len(before) >= PATIENCE:
                break
            continue
        if is_taken(current.model):
            break
        added = [name for name in names if name not in before] or [names[-1]]
        search.steps.append(_step(loop, opened, current.model, added, (held, remaining)))
        search.best, search.folds, held = current, folds, remaining
        if len(names) > 3 and loop.gap(current.residual) > HOPELESS * FLOOR_LEVEL:
            break
    if rival is not None and rival.terms and loop.allows(rival) and not is_taken(rival):
        fitted, folds = fit_figures(loop, rival)
        search.scores[tuple(sorted(rival.names()))] = score(loop, fitted)
        if score(loop, fitted) < score(loop, search.best):
            remaining = loop.held_out([fold.residual for fold in folds])
            search.steps = [_step(loop, opened, fitted.model, rival.names(), (plain, remaining))]
            search.best, search.folds = fitted, folds
    return search


def _step(
    loop: FreeLoop, opened: float, model: AxisModel, added: Sequence[str], held: tuple[F64, F64]
) -> Step:
    """A step of the selection.

    Args:
        loop: the axis.
        opened: squared gap over floor of the machine file.
        model: the effects from then on, fitted to all moves.
        added: names of those that the step added.
        held: energies of the moves before and after it, float64[moves] each.
    """
    _, uncertainty = _fall(loop, *held)
    above = opened - FLOOR_LEVEL
    closed = 1.0 - (float(held[1].sum() / loop.samples.sum()) - FLOOR_LEVEL) / above
    return Step(model.names(), tuple(added), closed, uncertainty / above, model)


class _Selection:
    """Fits of sets of effects, with the best one of each set.

    Args:
        loop: the axis.
        library: effects to consider.
    """

    def __init__(self, loop: FreeLoop, library: Mapping[str, Effect]) -> None:
        self._loop = loop
        self._library = library
        self._promising: set[str] = set()
        self._kept: dict[tuple[str, ...], Fitted] = {}
        self.scores: dict[tuple[str, ...], float] = {}

    def fit(self, model: AxisModel, iterations: int, base_columns: F64 | None = None) -> Fitted:
        """The best fit of a model's effects so far, this one included."""
        found = fit_free(self._loop, model, iterations, base_columns=base_columns)
        key, own = tuple(sorted(model.names())), score(self._loop, found)
        if key not in self.scores or own < self.scores[key]:
            self._kept[key], self.scores[key] = found, own
        return self._kept[key]

    def add_best(self, fitted: Fitted) -> Fitted | None:
        """The best effect beside a model; None where none changes anything."""
        found, base_columns = self._candidates(fitted, list(self._library))
        self._promising |= {c.term.name for c in found[:REMEMBERED]}
        return self._best_of(fitted, found[:FITTED], base_columns)

    def look_back(self, fitted: Fitted) -> Fitted:
        """Drop or replace earlier effects where that scores better."""
        for name in fitted.model.names()[:-1]:
            without = fitted.model.without(fitted.model.names().index(name))
            if not self._loop.allows(without):
                continue
            fewer = self.fit(without, SHORT)
            if score(self._loop, fewer) <= score(self._loop, fitted):
                fitted = fewer
                continue
            others = [other for other in sorted(self._promising) if other != name]
            starts, base_columns = self._candidates(fewer, others)
            swapped = self._best_of(fewer, starts[:RIVALS], base_columns)
            if swapped is not None and score(self._loop, swapped) < score(self._loop, fitted):
                fitted = swapped
        return fitted

    def _candidates(self, fitted: Fitted, names: Sequence[str]) -> tuple[list[Candidate], F64]:
        """Starts of these effects beside a model, best first; derivatives by base parameters."""
        dictionary = FreeDictionary(self._loop, fitted)
        candidates: list[Candidate] = []
        for name in names:
            if name not in fitted.model.names():
                candidates += dictionary.best(self._library[name])
        return sorted(candidates, key=lambda c: -c.gain), dictionary.base_columns

    def _best_of(
        self, fitted: Fitted, candidates: Sequence[Candidate], base_columns: F64
    ) -> Fitted | None:
        """The best of these candidates beside a model, fitted."""
        starts = [fitted.model.added(c.term) for c in candidates]
        allowed = [start for start in starts if self._loop.allows(start)]
        tried = [self.fit(start, SHORT, base_columns) for start in allowed]
        if not tried:
            return None
        return self.fit(min(tried, key=lambda f: score(self._loop, f)).model, LONG)


def fit_figures(loop: FreeLoop, model: AxisModel) -> tuple[Fitted, list[Fitted]]:
    """A model fitted to all moves, and to all but a fold's for each fold.

    Args:
        loop: the axis.
        model: whose effects are known; to start from.
    """
    fitted = fit_free(loop, model, LONG)
    return fitted, [fit_free(loop, fitted.model, SHORT, train) for train in _training(loop)]


def refit_without(search: FreeSearch, effect: str) -> FreeSearch:
    """A search without one of the effects that it found; the others are fitted anew."""
    loop, model = search.loop, search.best.model
    best, folds = fit_figures(loop, model.without(model.names().index(effect)))
    names = set(best.model.names())
    search.scores[tuple(sorted(names))] = score(loop, best)
    held, left = (loop.held_out([f.residual for f in each]) for each in (search.folds, folds))
    steps = [step for step in search.steps if set(step.effects) < names]
    steps.append(_step(loop, search.open_gap, best.model, (), (held, left)))
    return replace(search, best=best, folds=folds, steps=steps)


def fit_alone(
    loop: FreeLoop, effects: Iterable[Effect], at: Sequence[float] = ()
) -> list[AxisModel]:
    """Each effect by itself, fitted from its best start; those that change nothing are left out.

    Args:
        loop: the axis.
        effects: to be fitted.
        at: values of an effect's last parameters to start from, in their units; else a grid is
            tried.
    """
    plain = fit_free(loop, loop.start, SHORT)
    dictionary = FreeDictionary(loop, plain)
    starts = []
    for effect in effects:
        nodes = [(*typical(effect, loop.axis).values[: -len(at)], *at)] if at else None
        starts += [plain.model.added(c.term) for c in dictionary.best(effect, nodes=nodes)]
    return [fit_free(loop, start, SHORT).model for start in starts if loop.allows(start)]


def fit_folds(loop: FreeLoop, model: AxisModel, before: Sequence[Fitted]) -> list[Fitted]:
    """The effects of a model fitted to all moves but a fold's, for each fold.

    Start values are sought anew on these moves, since those of the model come from all moves.

    Args:
        loop: the axis.
        model: whose effects are fitted.
        before: fits of fewer effects, or of others, for each fold.
    """
    fits = []
    for train, own in zip(_training(loop), before, strict=True):
        kept = tuple(term for term in own.model.terms if term.name in model.names())
        remaining = AxisModel(own.model.base, kept)
        own = fit_free(loop, remaining if loop.allows(remaining) else loop.start, 2, train)
        for term in model.terms:
            if term.name in own.model.names():
                continue
            starts = FreeDictionary(loop, own, train).best(term.effect, 2)
            added = [own.model.added(s.term) for s in starts]
            tried = [fit_free(loop, start, SHORT, train) for start in added if loop.allows(start)]
            own = min([own, *tried], key=lambda f: f.cost)
        terms = {term.name: term for term in own.model.terms}
        ordered = tuple(terms[name] for name in model.names() if name in terms)
        fits.append(fit_free(loop, AxisModel(own.model.base, ordered), LONG, train))
    return fits


def _training(loop: FreeLoop) -> list[BoolArray]:
    """For each fold, the moves of all others, bool[moves]."""
    return [loop.fold != fold for fold in range(FOLDS)]


def is_certain(change: F64) -> bool:
    """Whether the gap falls by more than if chance gave the change of each move its sign.

    A sign-flip test: unlike a standard deviation over moves it allows for what fades, which changes
    the first moves most. Where there are too few moves for it, Student's t counts as well.

    Args:
        change: fall of the moves' energies, float64[moves].
    """
    count = len(change)
    if (change > 0.0).all():
        return True
    if 2.0 > CHANCE * 2.0**count:  # chance alone does as well where a single move is worse
        error = float(np.std(change, ddof=1)) / math.sqrt(count) if count > 1 else math.inf
        return bool(change.mean() > error * stdtrit(count - 1, 1.0 - CHANCE))
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (FLIPS, count))
    return bool(np.mean(signs @ change >= change.sum()) < CHANCE)


def _fall(loop: FreeLoop, before: F64, after: F64) -> tuple[float, float]:
    """Fall of the squared gap over floor, and its standard deviation over moves.

    Args:
        loop: the axis.
        before: energies of the moves, float64[moves].
        after: the same with an effect more.
    """
    change = (before - after) / loop.samples.sum()
    return float(change.sum()), float(np.std(change, ddof=1)) * math.sqrt(len(change))
