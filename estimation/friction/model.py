"""Friction laws by name, their parameters from an axis' figures, and the friction state.

Viscous friction sigma_v v is linear, the same in every law, and added by whoever uses the force.

Source: docs/reference/reference-stage.md, the plant.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.friction import coulomb, gms, law
from estimation.friction.law import Figures
from stagedata import F64, FrictionFigures, LawName

LAWS: dict[LawName, ModuleType] = {"gms": law.register(gms), "coulomb": law.register(coulomb)}
"""Friction laws by name, as in `stagedata.friction.LAW_FIGURES`."""


def make_constants(friction: FrictionFigures) -> Any:
    """The law's constants for compiled calls, see `estimation.friction.law`."""
    law_of = LAWS[friction.law]
    return law_of.make_constants(
        friction.elements, friction.stribeck_velocity, friction.stribeck_shape
    )


def count_states(friction: FrictionFigures) -> int:
    """How many internal forces the law has."""
    number: int = LAWS[friction.law].count_states(friction.elements)
    return number


def kernel_figures(friction: FrictionFigures, period: float) -> Figures:
    """The figures at which compiled calls evaluate the law; `period` of the samples [s]."""
    rate = friction.relaxation_rate
    kept = LAWS[friction.law].retained(make_constants(friction), rate, period)
    return Figures(friction.coulomb, friction.stiffness, rate, friction.static_ratio, period, kept)


def breakaway_travel(friction: FrictionFigures) -> float:
    """Displacement from relaxed to sliding, at most [m]; 0 without presliding."""
    constants = make_constants(friction)
    return float(
        law.breakaway_travel(constants, friction.coulomb, friction.stiffness, friction.static_ratio)
    )


@dataclass(slots=True)
class FrictionState:
    """Internal state of an axis' friction; changed in place as the axis moves.

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
        """No friction force, at rest at `position` [m]; `states` as of `count_states`."""
        return cls(np.zeros(states), np.zeros(states, dtype=np.bool_), np.array([0.0, position]))

    @property
    def total(self) -> float:
        """Sum of the internal forces [N]."""
        return float(self.forces.sum())

    @property
    def arrays(self) -> tuple[F64, NDArray[np.bool_], F64]:
        """All of it, as kernels take it."""
        return self.forces, self.slipping, self.memory

    def copy(self) -> FrictionState:
        """An independent copy."""
        return FrictionState(self.forces.copy(), self.slipping.copy(), self.memory.copy())

    def settle_at(self, position: float) -> None:
        """Take `position` [m] as where the axis rests now; the forces stay."""
        self.memory[1] = position

    def rescale(self, factor: float) -> None:
        """Carry the state over to a model whose Coulomb force is `factor` times the old one's."""
        self.forces *= factor

    def correct(self, total: float, friction: FrictionFigures) -> None:
        """Make the internal forces add up to `total` [N], the force measured at rest.

        As the law says (`law.correct`); what is beyond its static limit is left out.
        """
        static = friction.coulomb * (1.0 + friction.static_ratio)
        law.correct(make_constants(friction), self.forces, static, total)
