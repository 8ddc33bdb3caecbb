"""The model of one axis that is fitted: its base parameters and the effects that act on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from hil_sim.effects import Effect
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import SUBSTEPS, AxisSettings, StageSettings
from stagedata import F64

BASE = (
    "mass",
    "coulomb",
    "viscous",
    "stiffness",
    "static_ratio",
    "stribeck_velocity",
    "attraction",
)
"""Plant figures known to the machine file's tolerance; their relative deviations are nuisance
parameters."""
MAX_SIGMAS = 5.0
"""Plant figures stay within this many standard deviations: a larger deviation is an effect."""
STEP = len(BASE)
"""Index of the last nuisance parameter: how much finer a stage is integrated than the simulator,
whose step is not converged: 0 for the simulator's steps, 1 for infinitely fine ones. It is no
figure of the plant and appears in no twin."""
NUISANCES = STEP + 1
MAX_REFINEMENT = 0.8
"""Largest refinement of the integration steps that is assumed."""


@dataclass(frozen=True, slots=True)
class Term:
    """An effect with the values of its parameters, in their order."""

    effect: Effect
    values: tuple[float, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    def is_size_or_shape(self, key: str) -> bool:
        """Whether a parameter is a size or a shape, not a place or a phase."""
        return any(p.key == key and p.role in ("size", "shape") for p in self.effect.parameters)

    def ports(self, axis: AxisSettings) -> EffectPorts:
        """Where the effect enters an axis, over a moment."""
        ports = EffectPorts(axis, 1e-3, 1.0)
        self.effect.apply(ports, self.mapping())
        return ports

    def mapping(self) -> dict[str, float]:
        """Key -> value, in the unit of its parameter."""
        return {p.key: v for p, v in zip(self.effect.parameters, self.values, strict=True)}


@dataclass(frozen=True, slots=True, eq=False)
class AxisModel:
    """Base parameters and effects of one axis.

    Attributes:
        base: relative deviations from the machine file, then the refinement, float64[NUISANCES].
        terms: effects, in the order they were found.
    """

    base: F64
    terms: tuple[Term, ...] = ()

    def settings(self, nominal: AxisSettings) -> AxisSettings:
        """The axis in the simulator's terms.

        Raises:
            ValueError: values that physics does not allow.
        """
        return with_effects(with_base(nominal, self.base), self.terms)

    @property
    def substeps(self) -> float:
        """Plant steps per control tick that the stage takes."""
        return SUBSTEPS / (1.0 - float(self.base[STEP]))

    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(term.name for term in self.terms)

    def added(self, term: Term) -> AxisModel:
        """The model with one effect more."""
        return replace(self, terms=(*self.terms, term))

    def with_value(self, index: int, key: str, value: float) -> AxisModel:
        """The model with one parameter of one effect at another value."""
        term = self.terms[index]
        values = {**term.mapping(), key: value}
        changed = Term(term.effect, tuple(values[p.key] for p in term.effect.parameters))
        return replace(self, terms=(*self.terms[:index], changed, *self.terms[index + 1 :]))

    def without(self, index: int) -> AxisModel:
        """The model with one effect fewer."""
        return replace(self, terms=self.terms[:index] + self.terms[index + 1 :])


def with_base(nominal: AxisSettings, base: F64) -> AxisSettings:
    """The axis with its base parameters changed by relative deviations, float64[NUISANCES]."""
    factors = zip(BASE, 1.0 + base[:STEP], strict=True)
    return with_figures(nominal, {key: plant_figure(nominal, key) * f for key, f in factors})


def with_figures(axis: AxisSettings, figures: Mapping[str, float]) -> AxisSettings:
    """The axis with another mass [kg] or figures of its friction in SI units."""
    friction = {key: value for key, value in figures.items() if key != "mass"}
    return replace(
        axis,
        mass=figures.get("mass", axis.mass),
        friction=axis.friction.with_figures(friction) if friction else axis.friction,
    )


def plant_figure(axis: AxisSettings, figure: str) -> float:
    """The mass [kg] of an axis, or a figure of its friction in SI units."""
    return float(axis.mass if figure == "mass" else getattr(axis.friction, figure))


def with_effects(nominal: AxisSettings, terms: tuple[Term, ...]) -> AxisSettings:
    """The axis with effects added to its own."""
    return replace(
        nominal,
        effects=(*nominal.effects, *(term.effect.at(**term.mapping()) for term in terms)),
    )


def compose_stage(settings: StageSettings, models: Mapping[str, AxisModel]) -> StageSettings:
    """The stage with models of its axes; axes without a model stay as they are.

    Raises:
        ValueError: values that physics does not allow.
    """
    axes = settings.axes
    return replace(
        settings,
        axes=tuple(models[a.name].settings(a) if a.name in models else a for a in axes),
    )


def reported_values(term: Term) -> Mapping[str, float]:
    """Key -> value in the unit of its parameter, angles within 0..2 pi [rad]."""
    return {
        p.key: v % (2.0 * math.pi) if p.role == "phase" else v
        for p, v in zip(term.effect.parameters, term.values, strict=True)
    }
