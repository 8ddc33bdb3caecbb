"""Friction figures of an axis with their law by name, and what its friction remembers.

Viscous friction sigma_v v is linear, the same in every law, and added by whoever uses the force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from estimation.friction import coulomb, gms, law
from estimation.friction.gms import MAX_ELEMENTS
from estimation.friction.law import F64, Figures, FrictionLaw

LAWS: dict[str, FrictionLaw] = {
    "gms": law.register(cast(FrictionLaw, gms)),
    "coulomb": law.register(cast(FrictionLaw, coulomb)),
}
"""Friction laws by name."""


@dataclass(frozen=True, slots=True)
class Friction:
    """Parameters of one axis' friction.

    Attributes:
        elements: number N of Maxwell-slip elements, 1..64.
        coulomb: Fc [N].
        viscous: sigma_v [N s/m].
        stiffness: sigma0, initial presliding stiffness [N/m].
        relaxation_rate: C/Fc [1/s].
        static_ratio: alpha = (Fs - Fc)/Fc, > -1.
        stribeck_velocity: vs [m/s].
        stribeck_shape: delta.
        law: name of the friction law, of `LAWS`; one without presliding takes no notice of
            elements, stiffness and relaxation_rate.

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
    law: str = "gms"

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ValueError(f"law: must be one of {', '.join(LAWS)}, is {self.law!r}")
        if not 1 <= self.elements <= MAX_ELEMENTS:
            raise ValueError(f"elements: must be 1..{MAX_ELEMENTS}, is {self.elements}")
        for name in (
            "coulomb", "stiffness", "relaxation_rate", "stribeck_velocity", "stribeck_shape",
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name}: must be > 0, is {value!r}")
        if not (math.isfinite(self.viscous) and self.viscous >= 0):
            raise ValueError(f"viscous: must be >= 0, is {self.viscous!r}")
        if not (math.isfinite(self.static_ratio) and self.static_ratio > -1):
            raise ValueError(f"static_ratio: must be > -1, is {self.static_ratio!r}")

    @property
    def attraction(self) -> float:
        """C [N/s]."""
        return self.relaxation_rate * self.coulomb

    @property
    def breakaway_travel(self) -> float:
        """Displacement from relaxed to sliding, at most [m]."""
        return float(
            law.breakaway_travel(self.constants, self.coulomb, self.stiffness, self.static_ratio)
        )

    def scaled(self, factor: float) -> Friction:
        """Coulomb, viscous, stiffness and attraction figures times `factor` (C/Fc stays)."""
        return replace(
            self,
            coulomb=self.coulomb * factor,
            viscous=self.viscous * factor,
            stiffness=self.stiffness * factor,
        )

    @property
    def states(self) -> int:
        """How many internal forces the law has."""
        return self._law.count_states(self.elements)

    @property
    def constants(self) -> Any:
        """What compiled calls take of the law, see `FrictionLaw.Constants`."""
        return self._law.make_constants(self.elements, self.stribeck_velocity, self.stribeck_shape)

    @property
    def figures_of_law(self) -> tuple[str, ...]:
        """Which of the friction figures the law has."""
        return self._law.FIGURES

    def at(self, period: float) -> Figures:
        """The figures at which compiled calls evaluate the law; `period` of the samples [s]."""
        kept = law.retained(self.constants, self.relaxation_rate, period)
        return Figures(
            self.coulomb, self.stiffness, self.relaxation_rate, self.static_ratio, period, kept
        )

    @property
    def _law(self) -> FrictionLaw:
        return LAWS[self.law]


@dataclass(slots=True)
class FrictionState:
    """What an axis' friction remembers; changed in place as the axis moves.

    Attributes:
        forces: internal forces of the law, F_i [N], shape (n,).
        slipping: which of them slide, shape (n,).
        memory: [direction of motion (+1, -1, 0), position up to which motion was taken [m]].
    """

    forces: F64
    slipping: NDArray[np.bool_]
    memory: F64 = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def relaxed(cls, states: int, position: float = 0.0) -> FrictionState:
        """No friction force, at rest at `position` [m]; `states` as of `Friction.states`."""
        return cls(np.zeros(states), np.zeros(states, dtype=np.bool_), np.array([0.0, position]))

    @property
    def total(self) -> float:
        """Sum of the internal forces [N]."""
        return float(self.forces.sum())

    def copy(self) -> FrictionState:
        """An independent copy."""
        return FrictionState(self.forces.copy(), self.slipping.copy(), self.memory.copy())

    def settle_at(self, position: float) -> None:
        """Take `position` [m] as where the axis rests now; the forces stay."""
        self.memory[1] = position

    def rescale(self, factor: float) -> None:
        """Carry the state over to a model whose Coulomb force is `factor` times the old one's."""
        self.forces *= factor

    def correct(self, total: float, friction: Friction) -> None:
        """Make the internal forces add up to `total` [N], the force measured at rest.

        As the law says (`FrictionLaw.correct`); what is beyond its static limit is left out.
        """
        static = friction.coulomb * (1.0 + friction.static_ratio)
        law.correct(friction.constants, self.forces, static, total)
