"""Which effects act on an axis: forward selection on the innovations, each step looked back on.

Every effect of the library is scanned, the most promising ones are fitted beside what was found
before, and the best one stays if the recording asks for it. Afterwards each effect found is put to
the test again: would another one do as well in its place? What rivals come close to is kept, for
the probabilities and for the list of what these recordings cannot tell apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from sim2real.axis_model import AxisModel
from sim2real.fit import AxisProblem, Fitted, fit
from sim2real.scan import Scanner, Start

F64 = NDArray[np.float64]

MOST_EFFECTS = 2
"""Effects sought on one axis, at most."""
_FITTED = 4
"""Most promising effects that are fitted in each step."""
_PROMISING = 0.03
"""Effects are fitted whose first-order gain is at least this share of the best one's."""
_LEAST_GAIN = 600.0
"""Cost that an effect must save: nominal stages show accidental ones up to half of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """One way to explain an axis.

    Attributes:
        model: fitted.
        cost: of it, comparable within one stage.
    """

    model: AxisModel
    cost: float


@dataclass(slots=True, eq=False)
class AxisSearch:
    """What was found on one axis.

    Attributes:
        problem: that was searched.
        plain: base parameters alone.
        best: the effects found, fitted; equal to `plain` where there are none.
        whole: whether `best` leaves nothing but noise.
        closes: share of the axis' free closed-loop gap that `best` closes (`sim2real.gate`).
        rivals: sets of effects that were fitted, without duplicates, best first.
        scanned: effect -> first-order gain in the first scan.
        signatures: effect -> signature in the first scan, float64[R].
    """

    problem: AxisProblem
    plain: Fitted
    best: Fitted
    whole: bool = True
    closes: float = 0.0
    rivals: list[Rival] = field(default_factory=list)
    scanned: dict[str, float] = field(default_factory=dict)
    signatures: dict[str, F64] = field(default_factory=dict)


def search(
    problem: AxisProblem,
    library: Mapping[str, Effect],
    progress: Callable[[float], object] = lambda _: None,
) -> AxisSearch:
    """Find the effects of an axis.

    Args:
        problem: the axis.
        library: effects to consider.
        progress: called with the share done.
    """
    columns = problem.base_columns(problem.start, problem.residual(problem.start))
    plain = fit(problem, problem.start, 2, columns, thorough=False)
    found = AxisSearch(problem, plain, plain)
    current = plain
    seen: dict[tuple[str, ...], Rival] = {}

    def note(fitted: Fitted) -> None:
        key = tuple(sorted(fitted.model.names()))
        if key not in seen or fitted.cost < seen[key].cost:
            seen[key] = Rival(fitted.model, fitted.cost)

    note(plain)
    path = [plain]
    for depth in range(MOST_EFFECTS):
        # A plain fit to a stage with an effect bends the base parameters: start from none.
        current = path[-1] if depth else problem.at_start()
        problem.rescale(current.residual)
        current = problem.recosted(current)
        candidates, columns = _candidates(problem, current, library, found if depth == 0 else None)
        progress((depth + 0.4) / MOST_EFFECTS)
        if not candidates:
            break
        trials = []
        for start in candidates:
            trial = fit(problem, current.model.added(start.term), 5, columns, thorough=False)
            note(trial)
            trials.append(trial)
        best = fit(problem, min(trials, key=lambda t: t.cost).model, 4, thorough=False)
        note(best)
        if problem.recosted(path[-1]).cost - best.cost < _LEAST_GAIN:
            break
        if depth > 0:
            best = _looked_back(problem, best, library, note)
        path.append(best)
        progress((depth + 1) / MOST_EFFECTS)
        problem.rescale(best.residual)
        if problem.white(best.residual):
            break
    current = path[-1]
    problem.rescale(current.residual)
    found.best = fit(problem.finer(), current.model, 2) if current.model.terms else current
    found.whole = problem.nearly_white(found.best.residual)
    found.rivals = sorted(seen.values(), key=lambda rival: rival.cost)
    return found


def _candidates(
    problem: AxisProblem,
    current: Fitted,
    library: Mapping[str, Effect],
    found: AxisSearch | None,
) -> tuple[list[Start], F64]:
    columns = problem.base_columns(current.model, current.residual)
    scanner = Scanner(
        problem, current.model, current.residual, columns, problem.weights(current.residual)
    )
    starts: list[Start] = []
    for name, effect in library.items():
        if name in current.model.names():
            continue
        tried = scanner.best(effect)
        starts += tried
        if found is not None and tried:
            found.scanned[name] = tried[0].gain
            found.signatures[name] = tried[0].signature
    starts.sort(key=lambda start: -start.gain)
    if not starts or starts[0].gain < _LEAST_GAIN:
        return [], columns
    least = max(_LEAST_GAIN, _PROMISING * starts[0].gain)
    return [start for start in starts[:_FITTED] if start.gain >= least], columns


def _looked_back(
    problem: AxisProblem,
    current: Fitted,
    library: Mapping[str, Effect],
    note: Callable[[Fitted], None],
) -> Fitted:
    """Each earlier effect put to the test beside the later ones."""
    for index in range(len(current.model.terms) - 1):
        rest = fit(problem, current.model.without(index), 2, thorough=False)
        note(rest)
        if current.cost > rest.cost - _LEAST_GAIN:
            return rest
        starts, columns = _candidates(problem, rest, library, None)
        own = current.model.terms[index].name
        for start in [s for s in starts if s.term.name != own][:2]:
            trial = fit(problem, rest.model.added(start.term), 3, columns, thorough=False)
            note(trial)
            if trial.cost < current.cost:
                current = trial
                break
    return current
