"""A model of one axis that can be fitted: its base parameters and the effects that act on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import SUBSTEPS, AxisSettings, StageSettings

F64 = NDArray[np.float64]

BASE = (
    "mass",
    "coulomb",
    "viscous",
    "stiffness",
    "static_ratio",
    "stribeck_velocity",
    "attraction",
)
"""Plant figures that are known to the machine file's tolerance, relative deviations of which are
nuisance parameters."""
FARTHEST = 5.0
"""Plant figures stay within so many standard deviations: what lies beyond is an effect."""
STEP = len(BASE)
"""Where the last nuisance parameter stands: how far a stage is from being stepped as the simulator
is, which is not converged: 0 the simulator's steps, 1 infinitely fine ones. No figure of the plant,
and in no twin."""
NUISANCES = STEP + 1
FINEST = 0.8
"""Steps are taken to be at most so fine."""


@dataclass(frozen=True, slots=True)
class Term:
    """An effect with the values of its parameters, in their order."""

    effect: Effect
    values: tuple[float, ...]

    @property
    def name(self) -> str:
        """Of the effect."""
        return self.effect.name

    def is_size_or_shape(self, key: str) -> bool:
        """Whether a parameter says how much or how long, not where or at what angle."""
        return any(p.key == key and p.role in ("size", "shape") for p in self.effect.parameters)

    def mapping(self) -> dict[str, float]:
        """Key -> value."""
        return {p.key: v for p, v in zip(self.effect.parameters, self.values, strict=True)}


@dataclass(frozen=True, slots=True, eq=False)
class AxisModel:
    """Base parameters and effects of one axis.

    Attributes:
        base: relative deviations from the machine file, then the step's, float64[NUISANCES].
        terms: effects, in the order they were found.
    """

    base: F64
    terms: tuple[Term, ...] = ()

    def settings(self, nominal: AxisSettings) -> AxisSettings:
        """The axis as the simulator takes it.

        Raises:
            ValueError: values that physics does not allow.
        """
        return with_effects(with_base(nominal, self.base), self.terms)

    @property
    def fine(self) -> float:
        """Plant steps per control tick that the stage takes."""
        return SUBSTEPS / (1.0 - float(self.base[STEP]))

    def names(self) -> tuple[str, ...]:
        """Of the effects."""
        return tuple(term.name for term in self.terms)

    def added(self, term: Term) -> AxisModel:
        """With one effect more."""
        return replace(self, terms=(*self.terms, term))

    def with_value(self, index: int, key: str, value: float) -> AxisModel:
        """With one parameter of one effect at another value."""
        term = self.terms[index]
        values = {**term.mapping(), key: value}
        changed = Term(term.effect, tuple(values[p.key] for p in term.effect.parameters))
        return replace(self, terms=(*self.terms[:index], changed, *self.terms[index + 1 :]))

    def without(self, index: int) -> AxisModel:
        """With one effect fewer."""
        return replace(self, terms=self.terms[:index] + self.terms[index + 1 :])


def with_base(nominal: AxisSettings, base: F64) -> AxisSettings:
    """The axis with its base parameters moved by relative deviations."""
    factor = dict(zip(BASE, 1.0 + base[:STEP], strict=True))
    friction = nominal.friction
    return replace(
        nominal,
        mass=nominal.mass * factor["mass"],
        friction=replace(
            friction,
            **{key: getattr(friction, key) * factor[key] for key in BASE if key != "mass"},
        ),
    )


def with_effects(nominal: AxisSettings, terms: tuple[Term, ...]) -> AxisSettings:
    """The axis with effects added to those it has."""
    return replace(
        nominal,
        effects=(*nominal.effects, *(term.effect.at(**term.mapping()) for term in terms)),
    )


def composed(settings: StageSettings, models: Mapping[str, AxisModel]) -> StageSettings:
    """The stage with models of its axes; axes without one are as they were.

    Raises:
        ValueError: values that physics does not allow.
    """
    axes = settings.axes
    return replace(
        settings,
        axes=tuple(models[a.name].settings(a) if a.name in models else a for a in axes),
    )


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One parameter of an effect as the fit sees it: about 1 in size, free of bounds where it can.

    Attributes:
        parameter: of the effect.
        scale: typical size [the parameter's unit]; not used where `log`.
        log: the fit works in the logarithm.
        low, high: limits of the parameter.
        step: for differences, in fitted units.
        reach: most that one iteration may move it, in fitted units.
    """

    parameter: Parameter
    scale: float
    log: bool
    low: float
    high: float
    step: float
    reach: float

    def inward(self, value: float) -> float:
        """Fitted coordinate of a value."""
        return math.log(value) if self.log else value / self.scale

    def outward(self, coordinate: float) -> float:
        """Value of a fitted coordinate, inside the limits."""
        return self.clipped(
            math.exp(min(coordinate, 100.0)) if self.log else coordinate * self.scale
        )

    def clipped(self, value: float) -> float:
        """The value, or the limit that it lies beyond."""
        return min(max(value, self.low), self.high)

    def slope(self, value: float) -> float:
        """Change of the value per change of the coordinate."""
        return value if self.log else self.scale


_LIMIT = 4.0
"""Values are fitted up to so many times beyond what is plausible."""


def coordinates(effect: Effect, axis: AxisSettings) -> tuple[Coordinate, ...]:
    """How the parameters of an effect on an axis are fitted."""
    found = []
    for parameter in effect.parameters:
        ranges = parameter.ranges(axis)
        low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
        neutral = parameter.neutral_on(axis) or 0.0
        width = high - low
        floor = (
            max(parameter.above + 1e-9, parameter.least)
            if math.isfinite(max(parameter.above, parameter.least))
            else -math.inf
        )
        if parameter.role == "phase":
            entry = Coordinate(parameter, 1.0, False, -math.inf, math.inf, 0.01, 0.7)
        elif parameter.role == "place":
            margin = 0.5 * width
            # Where nothing is wide or narrow, the place is only an offset and may go far.
            reach = 0.5 if any(p.role == "shape" for p in effect.parameters) else 5.0
            entry = Coordinate(parameter, 0.01, False, low - margin, high + margin, 0.01, reach)
        elif parameter.log:
            entry = Coordinate(
                parameter, 1.0, True, max(floor, low / _LIMIT), high * _LIMIT, 0.003, 0.3
            )
        else:
            scale = max(abs(low - neutral), abs(high - neutral))
            limit = neutral + _LIMIT * scale
            entry = Coordinate(
                parameter, scale, False,
                max(floor, neutral - _LIMIT * scale), min(limit, parameter.below - 1e-9),
                0.01, 0.5,
            )  # fmt: skip
        found.append(entry)
    return tuple(found)


def coordinate(effect: Effect, key: str, axis: AxisSettings) -> Coordinate:
    """How one parameter is fitted."""
    return next(c for c in coordinates(effect, axis) if c.parameter.key == key)


_TENTH, _MOST_TENTHS = 0.1, 5.0
"""Unit of how far a value lies beyond what is plausible, of its range; the most that counts."""


def implausible(term: Term, axis: AxisSettings) -> float:
    """How far an effect's sizes and shapes lie beyond what is plausible, in tenths of its ranges.

    A size may be anything down to none. Each parameter counts by `_MOST_TENTHS` at most.
    """
    total = 0.0
    for parameter, value, near in zip(
        term.effect.parameters, term.values, plausible(term, axis).values, strict=True
    ):
        if value == near:
            continue
        ranges = parameter.ranges(axis)
        low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
        if parameter.log:
            away = abs(math.log(value / near)) / math.log(high / low)
        else:
            away = abs(value - near) / (high - low)
        total += min(away / _TENTH, _MOST_TENTHS)
    return total


def plausible(term: Term, axis: AxisSettings) -> Term:
    """The effect with sizes and shapes no farther than what is plausible."""
    turned = any(p.role == "phase" for p in term.effect.parameters)
    values = []
    for parameter, value in zip(term.effect.parameters, term.values, strict=True):
        if parameter.role not in ("size", "shape"):
            values.append(value)
            continue
        ranges = parameter.ranges(axis)
        low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
        if parameter.role == "size":
            neutral = parameter.neutral_on(axis)
            none = low if neutral is None else neutral
            low, high = min(low, none), max(high, none)
            if turned:  # half a turn changes the sign
                low = min(low, -high)
        values.append(min(max(value, low), high))
    return Term(term.effect, tuple(values))


def is_level(term: Term, axis: AxisSettings) -> bool:
    """Whether an effect is another Coulomb level, over time or place, which also wanders."""
    ports = EffectPorts(axis, 1e-3, 1.0)
    term.effect.apply(ports, term.mapping())
    tables = (ports.time_coulomb, ports.position_coulomb)
    courses = bool(ports.decays) or any(table is not None for table in tables)
    return courses or ports.coulomb != 1.0


def is_course(term: Term, axis: AxisSettings) -> bool:
    """Whether an effect is a Coulomb level that changes with time."""
    ports = EffectPorts(axis, 1e-3, 1.0)
    term.effect.apply(ports, term.mapping())
    return bool(ports.decays) or ports.time_coulomb is not None


_PLAIN = ("mass", "coulomb", "viscous", "stiffness", "static_ratio")
"""Ports that are figures of the plant."""


def within_tolerance(term: Term, axis: AxisSettings, tolerance: float) -> bool:
    """Whether an effect is but a plant figure off by what the machine file allows.

    A deviation beyond `FARTHEST` sigma is an effect (docs/formats/gap-report.md).
    """
    plain, ports = EffectPorts(axis, 1e-3, 1.0), EffectPorts(axis, 1e-3, 1.0)
    if len(term.values) != 1:
        return False
    term.effect.apply(ports, term.mapping())
    pairs = [(float(getattr(plain, name)), float(getattr(ports, name))) for name in _PLAIN]
    largest = max(abs(now - was) / was if was else abs(now) for was, now in pairs)
    return 0.0 < largest < FARTHEST * tolerance


def fitted(term: Term, axis: AxisSettings) -> F64:
    """Fitted coordinates of an effect's values."""
    return np.array(
        [c.inward(v) for c, v in zip(coordinates(term.effect, axis), term.values, strict=True)]
    )


def moved(term: Term, axis: AxisSettings, where: F64) -> Term:
    """The effect at other coordinates."""
    values = tuple(
        c.outward(float(u)) for c, u in zip(coordinates(term.effect, axis), where, strict=True)
    )
    return Term(term.effect, values)


def parameters(term: Term) -> Mapping[str, float]:
    """Key -> value, angles within 0..2 pi."""
    return {
        p.key: v % (2.0 * math.pi) if p.role == "phase" else v
        for p, v in zip(term.effect.parameters, term.values, strict=True)
    }
