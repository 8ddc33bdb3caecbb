"""Which effects act on an axis: forward selection, each step looked back on.

Every effect of the library is scanned, the most promising ones are fitted beside what was found
before, and the best one stays if the recording asks for it. Afterwards each effect found is put to
the test again: would another one do as well in its place? What rivals come close to is kept, for
the probabilities and for the list of what these recordings cannot tell apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import Book, Loop, Rival, sets_of
from sim2real.attribution.parameter_scan import Scanner, Start
from sim2real.attribution.refinement import LEAST_GAIN, contended, side_by_side
from sim2real.attribution.shape_check import Repeat
from sim2real.fitting import AxisModel, AxisProblem, Fitted, fit, within_tolerance
from sim2real.shrinkage import SIGNALS

F64 = NDArray[np.float64]

MOST_EFFECTS = 2
"""Effects sought on one axis, at most."""
_FITTED, _FITTED_FAINT = 4, 7
"""Most promising effects that are fitted in each step; where all of them promise little."""
_WANDERS = 2
"""And so many of those that the filter's wander speaks for."""
_PROMISING = 0.03
"""Effects are fitted whose first-order gain is at least this share of the best one's."""
_AGAIN = 0.01
"""The same share for effects that later scans look at, beside another effect."""
_FAINT = 40.0
"""First-order gain from which effects are fitted where the closed loop shows a gap."""
_OPEN = 2.0
"""Squared gap over floor per signal from which the closed loop shows one."""
_SHRUNK = (0.5, 0.0)
"""Shares of the fitted base parameters that are tried in the closed loop."""
_NARROW = 1000.0
"""Score up to which what was there before is fitted again, too, before an effect is added."""
_OTHERS, _WORSE, _BESIDE = 2, 1.3, 3
"""Single effects besides the best that pairs are built on where the best pair leaves something,
their score over the best one's, at most, and effects that are fitted beside each."""


@dataclass(slots=True, eq=False)
class AxisSearch:
    """What was found on one axis.

    Attributes:
        problem: that was searched.
        plain: base parameters alone.
        best: the effects found, fitted; equal to `plain` where there are none.
        open_gap: squared closed-loop gap over floor of the machine file on this axis.
        whole: whether `best` leaves nothing but noise, or there was nothing to explain.
        closes: share of the axis' free closed-loop gap that `best` closes (`sim2real.gate`).
        repeats: effects found, each once more beside itself (`sim2real.shape`).
        rivals: sets of effects that were fitted, without duplicates, best first.
        scanned: effect -> first-order gain in the first scan.
        signatures: effect -> signature in the first scan (`sim2real.scan.Start`).
    """

    problem: AxisProblem
    plain: Fitted
    best: Fitted
    open_gap: float = 0.0
    whole: bool = True
    closes: float = 0.0
    repeats: dict[str, Repeat] = field(default_factory=dict)
    rivals: list[Rival] = field(default_factory=list)
    scanned: dict[str, float] = field(default_factory=dict)
    signatures: dict[str, F64] = field(default_factory=dict)

    def without(self, names: tuple[str, ...]) -> None:
        """Take back a set of effects: the axis is as if it had not been thought of."""
        self.whole = False
        self.rivals = [r for r in self.rivals if set(r.model.names()) != set(names)]

    def reshaped(self, model: AxisModel, gap: float) -> None:
        """Set a model before all rivals."""
        residual = self.problem.attempted(model)
        cost = self.problem.cost(model, residual)
        self.rivals.insert(0, Rival(Fitted(model, cost, residual, None), gap))


def search(
    problem: AxisProblem,
    library: Mapping[str, Effect],
    loop: Loop,
    progress: Callable[[float], object] = lambda _: None,
) -> AxisSearch:
    """Find the effects of an axis.

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
    book = Book(problem, loop)
    path = [_no_worse(problem, book, plain)]
    promising: dict[str, Effect] = {}
    # What nobody sees in the closed loop is no gap, whatever the innovations say.
    for depth in range(MOST_EFFECTS if found.open_gap > _OPEN * SIGNALS else 0):
        # A plain fit to a stage with an effect bends the base parameters: start from none.
        current = path[-1].fitted if depth else problem.at_start()
        problem.rescale(current.residual)
        is_open = path[-1].gap > _OPEN * SIGNALS
        candidates, columns = _candidates(
            problem, current, library, is_open, found if depth == 0 else None, promising
        )
        progress((depth + 0.4) / MOST_EFFECTS)
        if not candidates:
            break
        beside = [current.model.added(start.term) for start in candidates]
        trials = side_by_side(problem, book, beside, 5, columns)
        best = contended(problem, book, trials)
        path[-1] = book.best(path[-1].model.names())
        if book.score(path[-1]) - book.score(best) < _NARROW:
            path[-1] = book.entered(fit(problem, path[-1].model, 4, thorough=False))
        if book.score(path[-1]) - book.score(best) < LEAST_GAIN:
            break
        if within_tolerance(best.model.terms[-1], problem.axis, float(problem.spread[0])):
            break
        if depth > 0:
            best = _looked_back(problem, best, promising, book, is_open)
        path.append(best)
        progress((depth + 1) / MOST_EFFECTS)
        problem.rescale(best.fitted.residual)
        if problem.white(best.fitted.residual) and best.gap < _OPEN * SIGNALS:
            break
    problem.rescale(path[-1].fitted.residual)
    last = path[-1]
    is_open = last.gap > _OPEN * SIGNALS
    if len(path) > 2 and (is_open or not problem.nearly_white(last.fitted.residual)):
        last = _otherwise(problem, last, promising, book)
        problem.rescale(last.fitted.residual)
    settled = _no_worse(problem, book, last.fitted)
    model = settled.fitted.model
    fine = problem.as_fine_as_needed(settled.fitted.residual)
    found.best = fit(fine, model, 2) if model.terms else settled.fitted
    nothing = not model.terms and settled.gap < _OPEN * SIGNALS
    found.whole = nothing or problem.nearly_white(found.best.residual)
    found.rivals = book.ranked()
    return found


def beside(found: AxisSearch, others: Sequence[AxisSettings]) -> None:
    """Fit an axis again whose effects feel other axes, beside these.

    Each axis was searched on its own, next to others as the machine file says.

    Args:
        found: changed in place.
        others: all axes with what was found on them.
    """
    problem, model = found.problem, found.best.model
    problem.beside(others)
    problem.regain(model)
    again = fit(problem, model, 4, thorough=False)
    problem.rescale(again.residual)
    found.best = fit(problem.as_fine_as_needed(again.residual), again.model, 2)
    found.whole = problem.nearly_white(found.best.residual)
    own = set(model.names())
    found.rivals = [
        replace(r, fitted=again if set(r.model.names()) == own else problem.revalued(r.fitted))
        for r in found.rivals
    ]


def _candidates(
    problem: AxisProblem,
    current: Fitted,
    library: Mapping[str, Effect],
    is_open: bool,
    found: AxisSearch | None = None,
    promising: dict[str, Effect] | None = None,
) -> tuple[list[Start], F64]:
    """Where to start fitting the most promising effects, and derivatives by base parameters.

    `found` keeps what the scan said; `promising` gains the effects that may be looked at again.
    """
    columns = problem.base_columns(current.model, current.residual)
    scanner = Scanner(
        problem, current.model, current.residual, columns, problem.weights(current.residual)
    )
    others = {n: effect for n, effect in library.items() if n not in current.model.names()}
    scanned = problem.workers.map(lambda effect: scanner.best(effect, 2), others.values())
    starts: list[Start] = []
    for name, tried in zip(others, scanned, strict=True):
        starts += tried
        if found is not None and tried:
            found.scanned[name] = tried[0].gain
            found.signatures[name] = tried[0].signature
    starts.sort(key=lambda start: -start.gain)
    if promising is not None:
        promising |= {
            s.term.name: library[s.term.name] for s in starts if s.gain >= _AGAIN * starts[0].gain
        }
    needed = _FAINT if is_open else LEAST_GAIN
    if not starts or starts[0].gain < needed:
        return [], columns
    least = max(needed, _PROMISING * starts[0].gain)
    most = _FITTED_FAINT if starts[0].gain < 10.0 * LEAST_GAIN else _FITTED
    chosen = [start for start in starts[:most] if start.gain >= least]
    if is_open:  # a wander weighs little beside innovations, whatever it does to the loop
        wanders = [s for s in starts if s.followed and s.gain >= needed and s not in chosen]
        chosen += wanders[:_WANDERS]
    return chosen, columns


def _no_worse(problem: AxisProblem, book: Book, fitted: Fitted) -> Rival:
    """The fit, or with its base parameters nearer to the machine file where the loop asks for it.

    What the innovations hardly weigh may bend base parameters by all that their tolerance allows.
    """
    tried = [book.entered(fitted)]
    for share in _SHRUNK:
        model = replace(fitted.model, base=share * fitted.model.base)
        residual = problem.residual(model)
        tried.append(book.entered(Fitted(model, problem.cost(model, residual), residual, None)))
    return min(tried, key=book.score)


def _looked_back(
    problem: AxisProblem,
    current: Rival,
    library: Mapping[str, Effect],
    book: Book,
    is_open: bool,
) -> Rival:
    """Each earlier effect put to the test beside the later ones."""
    for index in range(len(current.model.terms) - 1):
        book.entered(fit(problem, current.model.without(index), 2, thorough=False))
        rest = book.best(current.model.without(index).names())
        if book.score(current) > book.score(rest) - LEAST_GAIN:
            return rest
        starts, columns = _candidates(problem, rest.fitted, library, is_open)
        own = current.model.terms[index].name
        others = [s.term for s in starts if s.term.name != own][:2]
        beside = [rest.model.added(term) for term in others]
        trials = side_by_side(problem, book, beside, 3, columns)
        if trials:
            current = contended(problem, book, [current, *trials])
    return current


def _otherwise(
    problem: AxisProblem, current: Rival, library: Mapping[str, Effect], book: Book
) -> Rival:
    """Pairs built on other single effects than the best: two may look like a third one alone."""
    singles = sets_of(book.ranked(), 1)
    most = _WORSE * book.score(singles[0])
    others = [
        single
        for single in singles
        if single.model.names()[0] not in current.model.names() and book.score(single) < most
    ]
    for single in others[:_OTHERS]:
        starts, columns = _candidates(problem, single.fitted, library, True)
        beside = [single.model.added(start.term) for start in starts[:_BESIDE]]
        trials = side_by_side(problem, book, beside, 4, columns)
        if trials and min(map(book.score, trials)) < book.score(current):
            current = contended(problem, book, [current, *trials])
    return current
