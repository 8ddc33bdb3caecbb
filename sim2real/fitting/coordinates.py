"""Coordinates in which effects are fitted: scaled to about 1, unbounded where possible."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil_sim.effects import Effect, Parameter
from hil_sim.settings import AxisSettings
from sim2real.fitting.axis_model import AxisModel, Term
from stagedata import F64


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One parameter of an effect as the fit sees it.

    Attributes:
        parameter: of the effect.
        scale: typical size [the parameter's unit]; not used where `log`.
        log: the fit works in the logarithm.
        low, high: limits of the parameter.
        step: for difference quotients, in fitted units.
        reach: largest change in one iteration, in fitted units.
    """

    parameter: Parameter
    scale: float
    log: bool
    low: float
    high: float
    step: float
    reach: float

    def inward(self, value: float) -> float:
        """The coordinate of a value."""
        return math.log(value) if self.log else value / self.scale

    def outward(self, coordinate: float) -> float:
        """The value of a coordinate, within the limits."""
        return self.clipped(
            math.exp(min(coordinate, 100.0)) if self.log else coordinate * self.scale
        )

    def clipped(self, value: float) -> float:
        """The value, or the limit that it exceeds."""
        return min(max(value, self.low), self.high)

    def slope(self, value: float) -> float:
        """Change of the value per change of the coordinate."""
        return value if self.log else self.scale


_LIMIT = 4.0
"""Values may be fitted up to this many times beyond what is plausible. Where any size is
(`Effect.any_size`), sizes end at what physics allows. Those of forces, which are linear, are found
in one step: a weight or a pull may be many times the friction."""


def coordinates(effect: Effect, axis: AxisSettings) -> tuple[Coordinate, ...]:
    """The coordinates of an effect's parameters on an axis."""
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
            # Without a width, the place is a mere offset and may move far.
            reach = 0.5 if any(p.role == "shape" for p in effect.parameters) else 5.0
            entry = Coordinate(parameter, 0.01, False, low - margin, high + margin, 0.01, reach)
        elif parameter.log:
            entry = Coordinate(
                parameter, 1.0, True, max(floor, low / _LIMIT), high * _LIMIT, 0.003, 0.3
            )
        else:
            scale = max(abs(low - neutral), abs(high - neutral))
            is_free = effect.any_size and parameter.role == "size"
            limit = math.inf if is_free else _LIMIT * scale
            entry = Coordinate(
                parameter, scale, False,
                max(floor, neutral - limit), min(neutral + limit, parameter.below - 1e-9),
                0.01, math.inf if is_free and effect.group == "force" else 0.5,
            )  # fmt: skip
        found.append(entry)
    return tuple(found)


def coordinate(effect: Effect, key: str, axis: AxisSettings) -> Coordinate:
    """The coordinate of one parameter."""
    return next(c for c in coordinates(effect, axis) if c.parameter.key == key)


def to_coordinates(term: Term, axis: AxisSettings) -> F64:
    """Coordinates of an effect's values, float64[parameters]."""
    return np.array(
        [c.inward(v) for c, v in zip(coordinates(term.effect, axis), term.values, strict=True)]
    )


def from_coordinates(term: Term, axis: AxisSettings, where: F64) -> Term:
    """The effect at other coordinates, float64[parameters]."""
    values = tuple(
        c.outward(float(u)) for c, u in zip(coordinates(term.effect, axis), where, strict=True)
    )
    return Term(term.effect, values)


def effect_coordinates(model: AxisModel, axis: AxisSettings) -> F64:
    """Coordinates of all effects of a model, float64[P], in fitted units (`Coordinate`)."""
    return np.concatenate([np.empty(0), *(to_coordinates(term, axis) for term in model.terms)])


def with_coordinates(model: AxisModel, axis: AxisSettings, base: F64, where: F64) -> AxisModel:
    """The model with other base parameters and coordinates.

    Args:
        model: with its effects.
        axis: of the machine file.
        base: relative deviations and the refinement, float64[NUISANCES].
        where: coordinates of all effects in fitted units, float64[P].
    """
    widths = np.cumsum([len(term.values) for term in model.terms])
    parts = np.split(where, widths[:-1]) if model.terms else []
    terms = (
        from_coordinates(term, axis, part) for term, part in zip(model.terms, parts, strict=True)
    )
    return AxisModel(base, tuple(terms))
