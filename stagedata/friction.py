"""Friction figures of an axis: of the simulated plant, of the estimator's model, of a machine file.

Figures only. How a force follows from them is the business of a friction law, of which the
simulator (`hil_sim.plant.friction`) and the estimator (`estimation.friction`) each have their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

LawName = Literal["gms", "coulomb"]

_SHARED = ("coulomb", "viscous", "static_ratio", "stribeck_velocity", "stribeck_shape")
LAW_FIGURES: Mapping[LawName, tuple[str, ...]] = {
    "gms": ("elements", "stiffness", "relaxation_rate", "attraction"),
    "coulomb": (),
}
"""Friction laws by name, with the figures that each has beside those of all laws."""

_POSITIVE = ("coulomb", "stiffness", "relaxation_rate", "stribeck_velocity", "stribeck_shape")
_OF_SOME_LAWS = ("elements", "stiffness", "relaxation_rate")
MAX_ELEMENTS = 64


@dataclass(frozen=True, slots=True)
class FrictionFigures:
    """Friction figures of one axis. One that its law does not have is 0.

    Attributes:
        elements: number N of Maxwell-slip elements, 1..64.
        coulomb: Fc [N].
        viscous: sigma_v [N s/m].
        stiffness: sigma0, initial presliding stiffness [N/m].
        relaxation_rate: C/Fc [1/s]: it stays when Fc changes.
        static_ratio: alpha = (Fs - Fc)/Fc, > -1.
        stribeck_velocity: vs [m/s].
        stribeck_shape: delta.
        law: name of the friction law, of `LAW_FIGURES`.

    Raises:
        ValueError: a figure outside its range, named.
    """

    elements: int
    coulomb: float
    viscous: float
    stiffness: float
    relaxation_rate: float
    static_ratio: float
    stribeck_velocity: float
    stribeck_shape: float
    law: LawName = "gms"

    def __post_init__(self) -> None:
        if self.law not in LAW_FIGURES:
            raise ValueError(f"law: must be one of {', '.join(LAW_FIGURES)}, is {self.law!r}")
        if self.has("elements") and not 1 <= self.elements <= MAX_ELEMENTS:
            raise ValueError(f"elements: must be 1..{MAX_ELEMENTS}, is {self.elements}")
        for name in _POSITIVE:
            if not 0.0 < getattr(self, name) < math.inf and self.has(name):
                raise ValueError(f"{name}: must be > 0, is {getattr(self, name)!r}")
        for name in _OF_SOME_LAWS:
            if not self.has(name) and getattr(self, name) != 0:
                raise ValueError(f"{name}: the law {self.law} has none, is {getattr(self, name)!r}")
        if not (math.isfinite(self.viscous) and self.viscous >= 0):
            raise ValueError(f"viscous: must be >= 0, is {self.viscous!r}")
        if not (math.isfinite(self.static_ratio) and self.static_ratio > -1):
            raise ValueError(f"static_ratio: must be > -1, is {self.static_ratio!r}")

    def has(self, figure: str) -> bool:
        """Whether the law has a figure of this name."""
        return figure in _SHARED or figure in LAW_FIGURES[self.law]

    @property
    def attraction(self) -> float:
        """C [N/s]."""
        return self.relaxation_rate * self.coulomb

    def scaled(self, factor: float) -> FrictionFigures:
        """Coulomb, viscous, stiffness and attraction figures times `factor` (C/Fc stays)."""
        return replace(
            self,
            coulomb=self.coulomb * factor,
            viscous=self.viscous * factor,
            stiffness=self.stiffness * factor,
        )

    def with_figures(self, figures: Mapping[str, float]) -> FrictionFigures:
        """A copy with other figures, by name; `attraction` [N/s] may stand for the rate."""
        changed = dict(figures)
        if "attraction" in changed:
            coulomb = changed.get("coulomb", self.coulomb)
            changed["relaxation_rate"] = changed.pop("attraction") / coulomb
        return replace(self, **changed)  # type: ignore[arg-type]
