"""Whether an effect departs from its equation: the same effect fitted once more, beside itself.

A real effect of a family need not have the library's shape: cogging has harmonics, a worn spot
is not a bell, a warm-up has two time constants, a cable two strands. What such an effect leaves
is best explained by its own kind again; what an unlisted effect leaves, in whose place the
nearest effect was put, is not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects import Effect, Parameter
from hil_sim.settings import AxisSettings
from sim2real.attribution.candidates import TrackedDictionary
from sim2real.attribution.free_form import is_profile
from sim2real.dictionary import Dictionary
from sim2real.fitting import (
    AxisModel,
    AxisProblem,
    Fitted,
    Term,
    coordinates,
    fit,
    is_coulomb_drift,
    is_coulomb_level,
)
from sim2real.held_out import FLOOR_LEVEL
from sim2real.scoring.constants import (
    AGAINST,
    COURSE,
    FAMILY,
    IN_TUNE,
    LEAST_GAIN,
    NEAR,
    ORDERS,
    REPEATED,
)

F64 = NDArray[np.float64]

_FASTER = (0.2, 5.0)
"""What an effect found may be the faster or the slower part of: the other's shape, over its own."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """An effect that was found, fitted once more beside itself.

    Attributes:
        gain: cost that the repeat saves.
        share: of the residual force in motion that its kind explains in any shape
            (`sim2real.attribution.free_form`); 0 where that is not known.
        excess: cost beyond that of noise, before.
        gap, before: squared closed-loop gap over floor with it and without.
        model: with it.
        course: whether the effect is a Coulomb level that changes with time.
    """

    gain: float
    share: float
    excess: float
    gap: float
    before: float
    model: AxisModel
    course: bool = False

    def alone(self, name: str) -> list[AxisModel]:
        """Each effect of a name in the model with the repeat, by itself."""
        each = [replace(self.model, terms=(t,)) for t in self.model.terms]
        return [model for model in each if model.names() == (name,)]

    @property
    def is_free(self) -> bool:
        """Whether what is left is of the same kind in another shape, and more than noise."""
        return self.share > REPEATED and self.before > NEAR * FLOOR_LEVEL

    @property
    def closes(self) -> bool:
        """Whether the repeat takes up most of what is left in the closed loop."""
        return self.before - self.gap >= REPEATED * (self.before - NEAR * FLOOR_LEVEL)

    @property
    def departs(self) -> bool:
        """Whether the repeat takes up most of what is left, beyond chance."""
        if self.is_free:
            return True
        if self.course and self.gain > COURSE and self.gap < self.before:
            return True
        return self.closes and self.gain > max(LEAST_GAIN, REPEATED * self.excess)

    def is_family(self, opened: float) -> bool:
        """Whether the effect is of the right family, in another shape.

        Args:
            opened: squared closed-loop gap over floor of the machine file.
        """
        closed = (opened - self.gap) / max(opened - FLOOR_LEVEL, 1e-9)
        return self.departs and self.before < opened and closed > FAMILY


def fit_repeats(
    problem: AxisProblem,
    model: AxisModel,
    library: Mapping[str, Effect],
    loop: Callable[[AxisModel], float],
    share: Callable[[Effect, AxisModel], float],
) -> dict[str, Repeat]:
    """Fit each effect found a second time beside all of them.

    Dynamic effects, and effects without a shape parameter, are left out.

    Args:
        problem: the axis.
        model: with the effects found.
        library: effects by name.
        loop: squared closed-loop gap of the axis under a model.
        share: of what a model leaves in motion, explained by an effect's kind in any shape.
    """
    single = fit(problem, model, 1, thorough=False)
    problem.rescale(single.residual)
    single = problem.recosted(single)
    columns = problem.base_columns(single.model, single.residual)
    dictionary = TrackedDictionary(problem, single, columns)
    out = {}
    for index, term in enumerate(model.terms):
        if term.effect.group == "dynamics" or not _has_shape(term.effect):
            continue
        starts = _repeat_starts(single.model, index, dictionary, library[term.name], problem.axis)
        trials = problem.workers.map(
            lambda start: fit(problem, start, 10, columns, thorough=False), starts
        )
        trials = [trial for trial in trials if are_harmonics(trial.model, term)]
        if not trials:
            continue
        best = min(trials, key=lambda trial: trial.cost)
        course = is_coulomb_drift(term, problem.axis)
        refitted = _fit_single(problem, best.model, term.name, columns) if course else single
        repeat = Repeat(
            min(single.cost, refitted.cost) - best.cost,
            share(term.effect, single.model),
            single.cost - problem.expected_cost(),
            loop(best.model),
            loop(single.model),
            best.model,
            course,
        )
        out[term.name] = repeat
        if repeat.closes and repeat.gain > LEAST_GAIN and not repeat.departs:
            out[term.name] = _fit_further(problem, repeat, single, best, loop)
    return out


def _fit_single(problem: AxisProblem, model: AxisModel, name: str, columns: F64) -> Fitted:
    """Fit a model with a repeat without it again: other values may have been what gained."""
    last = max(i for i, term in enumerate(model.terms) if term.name == name)
    return fit(problem, model.without(last), 10, columns, thorough=False)


def _fit_further(
    problem: AxisProblem,
    repeat: Repeat,
    single: Fitted,
    best: Fitted,
    loop: Callable[[AxisModel], float],
) -> Repeat:
    """Fit a repeat further that closes enough of the gap and saves too little cost.

    Until here, derivatives by the base parameters and outlier limit were those of the single
    effect.
    """
    wide = problem.outlier
    problem.rescale(best.residual)
    again = fit(problem, best.model, 10, thorough=False)
    before = problem.recosted(single).cost
    gain, excess = before - again.cost, before - problem.expected_cost()
    problem.outlier = wide
    return replace(repeat, gain=gain, excess=excess, gap=loop(again.model), model=again.model)


def free_form_repeat(
    model: AxisModel, shares: tuple[float, float], gaps: tuple[float, float]
) -> Repeat:
    """The repeat that stands for an effect in free form, which cannot be simulated.

    Its gap is what the free form would leave; the gap before is that of the library's nearest.

    Args:
        model: with the nearest effect of the library.
        shares: of the residual force in motion that its kind explains in any shape: by the machine
            file, and by this model.
        gaps: squared closed-loop gap over floor of either.
    """
    closed = min(
        FLOOR_LEVEL + (gap - FLOOR_LEVEL) * (1.0 - share)
        for gap, share in zip(gaps, shares, strict=True)
    )
    return Repeat(0.0, max(shares), 0.0, max(closed, FLOOR_LEVEL), gaps[1], model)


def is_one_profile(
    model: AxisModel, open_gap: float, axis: AxisSettings, loop: Callable[[AxisModel], float]
) -> bool:
    """Whether two effects are a single friction profile: a level and a bell that cancel.

    Without one of them, the other leaves a wider gap than there was.
    """
    terms = model.terms
    if len(terms) != 2 or not all(is_coulomb_level(term, axis) for term in terms):
        return False
    if not any(is_profile(term.effect, axis) for term in terms):
        return False
    return max(loop(model.without(index)) for index in range(2)) > AGAINST * open_gap


def _repeat_starts(
    model: AxisModel, index: int, dictionary: Dictionary, effect: Effect, axis: AxisSettings
) -> list[AxisModel]:
    """Where to start with an effect twice: beside itself, or split in two."""
    term = model.terms[index]
    starts = []
    nodes = [_harmonics(term, orders) for orders in ORDERS] if _is_periodic(effect) else [None]
    for wave in nodes:
        if candidates := dictionary.best(effect, nodes=wave):
            starts.append(replace(model, terms=(*model.terms, *(s.term for s in candidates))))
    if nodes == [None]:
        halves = tuple(_split_half(term, side, axis) for side in (-1.0, 1.0))
        rest = model.without(index)
        starts.append(replace(rest, terms=(*rest.terms, *halves)))
        if not any(p.role == "place" for p in effect.parameters):
            starts += [model.added(_otherwise_fast(term, by, axis)) for by in _FASTER]
    return starts


def _otherwise_fast(term: Term, by: float, axis: AxisSettings) -> Term:
    """The same effect with all shape parameters this many times as large."""
    entries = coordinates(term.effect, axis)
    values = [
        entry.clipped(value * (by if entry.parameter.role == "shape" else 1.0))
        for entry, value in zip(entries, term.values, strict=True)
    ]
    return Term(term.effect, tuple(values))


def _split_half(term: Term, side: float, axis: AxisSettings) -> Term:
    """One of two halves: side by side and narrower if placed, else a fast and a slow one."""
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


def _has_shape(effect: Effect) -> bool:
    return any(p.role == "shape" for p in effect.parameters)


def _is_periodic(effect: Effect) -> bool:
    return any(p.role == "phase" for p in effect.parameters)


def _harmonics(term: Term, orders: Sequence[float]) -> list[tuple[float, ...]]:
    """Values of the wave whose order, relative to the term's, is each of these."""
    return [
        tuple(
            v * _factor(p, order) for p, v in zip(term.effect.parameters, term.values, strict=True)
        )
        for order in orders
    ]


def are_harmonics(model: AxisModel, term: Term) -> bool:
    """Whether all waves of an effect in a model are harmonics of one; True if it is not periodic.

    Waves of arbitrary pitches could describe any force over position.
    """
    shape = next(i for i, p in enumerate(term.effect.parameters) if p.role == "shape")
    if not _is_periodic(term.effect):
        return True
    values = [t.values[shape] for t in model.terms if t.name == term.name]
    in_time = term.effect.parameters[shape].unit == "Hz"
    orders = [v / min(values) if in_time else max(values) / v for v in values]
    return all(abs(order / round(order) - 1.0) < IN_TUNE for order in orders)


def _factor(parameter: Parameter, order: float) -> float:
    if parameter.role != "shape":
        return 1.0
    return order if parameter.unit == "Hz" else 1.0 / order
