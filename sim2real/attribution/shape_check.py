"""Whether an effect departs from its equation: the same one once more, beside itself.

A real effect of a family need not have the library's shape: cogging has harmonics, a worn spot is
no bell, a warm-up has two time constants, a cable two strands. What such an effect leaves over is
best taken up by its own kind again; what a stranger leaves over, on whose place the nearest effect
was put, is not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.settings import AxisSettings
from sim2real.attribution.free_form import is_profile
from sim2real.attribution.parameter_scan import Scanner
from sim2real.fitting import (
    AxisModel,
    AxisProblem,
    Fitted,
    Term,
    coordinates,
    fit,
    is_course,
    is_level,
)
from sim2real.shrinkage import SIGNALS

F64 = NDArray[np.float64]

_HARMONICS, _FUNDAMENTAL = (2.0, 3.0), 0.5
"""Harmonics that are tried of what is periodic; and what was found may be the second itself."""

_LEAST_GAIN, _MOST = 100.0, 0.5
"""Cost that a repeat must save, and the share of what is left (of the closed-loop gap, too), for an
effect to depart."""
_COURSE = 15.0
"""The same for a course of the Coulomb level over time, which a filter follows and friction's
wander hides: true ones save up to 9 if the gap does not open."""
_CLOSED = 3.0 * SIGNALS
"""Squared closed-loop gap over floor of an axis that asks for nothing more."""
_AGAINST = 1.5
"""How much more of the machine file's own gap is open where one of a pair is left out, for the pair
to be one profile."""
_TRIES, _NEAR = 60, 0.02
"""Closed loops that a search for the nearest effect may take, and where it may end: logarithm of
the gap, and coordinates."""
_FIRST, _LEAST_FIRST = 0.1, 0.05
"""Its first steps, of each coordinate, and the least of them."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """An effect that was found, fitted once more beside itself.

    Attributes:
        gain: cost that the repeat saves.
        share: of the force left in motion that its kind takes in any shape
            (`sim2real.free_form`); 0 where no such thing is known of it.
        excess: cost beyond what noise would have, before.
        gap, before: squared closed-loop gap over floor with it and without.
        model: with it.
        course: whether the effect is a course of the Coulomb level over time.
    """

    gain: float
    share: float
    excess: float
    gap: float
    before: float
    model: AxisModel
    course: bool = False

    def alone(self, name: str) -> list[AxisModel]:
        """Each effect of a name in the model with it, by itself."""
        each = [replace(self.model, terms=(t,)) for t in self.model.terms]
        return [model for model in each if model.names() == (name,)]

    @property
    def is_free(self) -> bool:
        """Whether what is left is of the same kind in another shape, and more than nothing."""
        return self.share > _MOST and self.before > _CLOSED

    @property
    def closes(self) -> bool:
        """Whether the repeat takes up most of what is left in the closed loop."""
        return self.before - self.gap >= _MOST * (self.before - _CLOSED)

    @property
    def departs(self) -> bool:
        """Whether the repeat takes up most of what is left, which is more than chance."""
        if self.is_free:
            return True
        if self.course and self.gain > _COURSE and self.gap < self.before:
            return True
        return self.closes and self.gain > max(_LEAST_GAIN, _MOST * self.excess)


def repeats(
    problem: AxisProblem,
    model: AxisModel,
    library: Mapping[str, Effect],
    loop: Callable[[AxisModel], float],
    share: Callable[[Effect, AxisModel], float],
) -> dict[str, Repeat]:
    """Each effect found, fitted once more beside all of them; effects without a shape left out.

    Args:
        problem: the axis.
        model: with the effects found.
        library: effects by name.
        loop: squared closed-loop gap of the axis under a model.
        share: of what a model leaves in motion, what an effect's kind takes in any shape.
    """
    found = fit(problem, model, 1, thorough=False)
    problem.rescale(found.residual)
    found = problem.recosted(found)
    columns = problem.base_columns(found.model, found.residual)
    scanner = Scanner(
        problem, found.model, found.residual, columns, problem.weights(found.residual)
    )
    out = {}
    for index, term in enumerate(model.terms):
        if term.effect.group == "dynamics" or not _shaped(term.effect):
            continue
        starts = _again(found.model, index, scanner, library[term.name], problem.axis)
        if _is_periodic(term.effect) and not problem.nearly_white(found.residual):
            starts += _anew(problem, found.model, index, library[term.name])
        trials = problem.workers.map(
            lambda start: fit(problem, start, 10, columns, thorough=False), starts
        )
        if not trials:
            continue
        best = min(trials, key=lambda trial: trial.cost)
        repeat = Repeat(
            found.cost - best.cost,
            share(term.effect, found.model),
            found.cost - problem.expected(),
            loop(best.model),
            loop(found.model),
            best.model,
            is_course(term, problem.axis),
        )
        out[term.name] = repeat
        if repeat.closes and repeat.gain > _LEAST_GAIN and not repeat.departs:
            out[term.name] = _farther(problem, repeat, found, best, loop)
    return out


def _farther(
    problem: AxisProblem,
    repeat: Repeat,
    found: Fitted,
    best: Fitted,
    loop: Callable[[AxisModel], float],
) -> Repeat:
    """A repeat that closes enough and saves too little, fitted on from where it is.

    The derivatives by the base parameters were those of the single effect, and so was the size
    from which deviations count as outliers.
    """
    wide = problem.outlier
    problem.rescale(best.residual)
    again = fit(problem, best.model, 10, thorough=False)
    before = problem.recosted(found).cost
    gain, excess = before - again.cost, before - problem.expected()
    problem.outlier = wide
    return replace(repeat, gain=gain, excess=excess, gap=loop(again.model), model=again.model)


def in_free_form(
    model: AxisModel, shares: tuple[float, float], gaps: tuple[float, float]
) -> Repeat:
    """An effect in a shape of its own: what that would close, and what the nearest one leaves.

    Args:
        model: with the effect of the library that comes nearest.
        shares: of the force that is left in motion, what its kind takes in any shape: by the
            machine file, and by this model.
        gaps: squared closed-loop gap over floor of either.
    """
    closed = min(
        SIGNALS + (gap - SIGNALS) * (1.0 - share) for gap, share in zip(gaps, shares, strict=True)
    )
    return Repeat(0.0, max(shares), 0.0, max(closed, SIGNALS), gaps[1], model)


def is_one_profile(
    model: AxisModel, open_gap: float, axis: AxisSettings, loop: Callable[[AxisModel], float]
) -> bool:
    """Whether two effects are one friction profile: a level and a bell against each other.

    Without the one, the other opens more than there was.
    """
    terms = model.terms
    if len(terms) != 2 or not all(is_level(term, axis) for term in terms):
        return False
    if not any(is_profile(term.effect, axis) for term in terms):
        return False
    return max(loop(model.without(index)) for index in range(2)) > _AGAINST * open_gap


def nearest(
    starts: Sequence[AxisModel], axis: AxisSettings, loop: Callable[[AxisModel], float]
) -> AxisModel:
    """The one effect of its kind that comes nearest to one in another shape, in the closed loop.

    Innovations that an effect cannot take up bend it: a bell in place of a stretch ends half as
    high, a wave in place of two at the lesser one's pitch.

    Args:
        starts: models with the effect alone, one of them at least.
        axis: of the machine file.
        loop: squared closed-loop gap of the axis under a model.
    """
    start = min(starts, key=loop)
    own = start.terms[0]
    entries = coordinates(own.effect, axis)

    def at(where: F64) -> AxisModel:
        values = tuple(e.outward(float(w)) for e, w in zip(entries, where, strict=True))
        return replace(start, terms=(Term(own.effect, values),))

    def gap(where: F64) -> float:
        try:
            return float(np.log(loop(at(where))))
        except ValueError:  # not possible
            return np.inf

    first = np.array([e.inward(v) for e, v in zip(entries, start.terms[0].values, strict=True)])
    steps = np.diag(np.maximum(_FIRST * np.abs(first), _LEAST_FIRST))
    found = minimize(
        gap,
        first,
        method="Nelder-Mead",
        options={
            "maxfev": _TRIES,
            "initial_simplex": np.vstack([first, first + steps]),
            "xatol": _NEAR,
            "fatol": _NEAR,
        },
    )
    return at(found.x)


def _again(
    model: AxisModel, index: int, scanner: Scanner, effect: Effect, axis: AxisSettings
) -> list[AxisModel]:
    """Where to start with one effect twice: beside what is there, or split in two."""
    term = model.terms[index]
    nodes = _waves(term, _HARMONICS) if _is_periodic(effect) else None
    found = []
    if starts := scanner.best(effect, nodes=nodes):
        found.append(replace(model, terms=(*model.terms, *(s.term for s in starts))))
    if nodes is None:
        halves = tuple(_half(term, side, axis) for side in (-1.0, 1.0))
        rest = model.without(index)
        found.append(replace(rest, terms=(*rest.terms, *halves)))
    return found


def _anew(problem: AxisProblem, model: AxisModel, index: int, effect: Effect) -> list[AxisModel]:
    """Where to start with a wave and its harmonics together, from the machine file's figures.

    A wave alone, fitted where there are two, bends everything else; and it may be the second.
    """
    rest = replace(model.without(index), base=problem.start.base)
    residual = problem.residual(rest)
    problem.rescale(residual)
    columns = problem.base_columns(rest, residual)
    scanner = Scanner(problem, rest, residual, columns, problem.weights(residual))
    found = []
    for orders in ((1.0, *_HARMONICS), (1.0, _FUNDAMENTAL)):
        starts = scanner.best(effect, nodes=_waves(model.terms[index], orders))
        if len(starts) > 1:
            found.append(replace(rest, terms=(*rest.terms, *(s.term for s in starts))))
    return found


def _half(term: Term, side: float, axis: AxisSettings) -> Term:
    """One of two: side by side and narrower where there is a place, else a fast and a slow one."""
    values = term.mapping()
    roles = {p.role: p.key for p in term.effect.parameters}
    if "place" in roles:
        values[roles["place"]] += side * 0.8 * values[roles["shape"]]
        factors = {"size": 0.8, "shape": 0.6}
    else:
        factors = {"size": 0.5, "shape": 2.0**side}
    return Term(
        term.effect,
        tuple(
            entry.clipped(values[entry.parameter.key] * factors.get(entry.parameter.role, 1.0))
            for entry in coordinates(term.effect, axis)
        ),
    )


def _shaped(effect: Effect) -> bool:
    return any(p.role == "shape" for p in effect.parameters)


def _is_periodic(effect: Effect) -> bool:
    return any(p.role == "phase" for p in effect.parameters)


def _waves(term: Term, orders: Sequence[float]) -> list[tuple[float, ...]]:
    """The same at pitches so many times shorter, or at frequencies so many times higher."""
    return [
        tuple(
            v * _factor(p, order) for p, v in zip(term.effect.parameters, term.values, strict=True)
        )
        for order in orders
    ]


def _factor(parameter: Parameter, order: float) -> float:
    if parameter.role != "shape":
        return 1.0
    return order if parameter.unit == "Hz" else 1.0 / order
