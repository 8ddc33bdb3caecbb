"""Known effects of one axis, in the terms that the host can compensate.

An effect's inverse writes into these: several effects add up where they are forces, and multiply
where they are factors. F_d is force against positive motion, as in docs/formats/effects.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from stagedata import F64, FrictionFigures

Curve = Callable[[F64], F64]
"""A function of positions [m], velocities [m/s] or times [s], of any shape; returns the same."""
FrictionCurve = Callable[[F64, FrictionFigures], F64]
"""A function of velocities [m/s], relative to friction figures; returns the same shape."""
Surface = Callable[[F64, F64], F64]
"""A function of positions of this axis and of the other one [m], of one shape."""


class Base(NamedTuple):
    """A base on isolators: moved mass over its mass, frequency [Hz], damping ratio."""

    mass_ratio: float
    frequency: float
    damping: float


@dataclass(slots=True)
class KnownTerms:
    """Terms of one axis; by default none.

    Attributes:
        mass: added to the moved mass [kg].
        coulomb, viscous, stiffness: factors on the friction figures of the machine file.
        static_ratio: alpha in place of the machine file's; None: that one.
        bandwidth: of the current loop in place of the machine file's [Hz]; None: that one.
        delay: dead time of the drive's output [s].
        gain: force on the carriage over measured force.
        saturation: force on the carriage is this times tanh(F / this) [N].
        gains: factors on the force on the carriage over position, after saturation.
        forces: disturbance forces over position [N].
        velocity_forces: disturbance forces over velocity [N].
        friction_forces: those relative to the machine file's friction figures [N].
        hysteresis: elements (force [N], stiffness [N/m]): dH = stiffness dx within ± force.
        coupled_mass: disturbance force per acceleration of the other axis [kg].
        bases: under the axis.
        forward, backward: factors on Fc for each direction.
        table_factors: factors on Fc over the positions of both axes.
        time_factors: factors on Fc over the time since the first SYNC.
    """

    mass: float = 0.0
    coulomb: float = 1.0
    viscous: float = 1.0
    stiffness: float = 1.0
    static_ratio: float | None = None
    bandwidth: float | None = None
    delay: float = 0.0
    gain: float = 1.0
    saturation: float = math.inf
    gains: list[Curve] = field(default_factory=list)
    forces: list[Curve] = field(default_factory=list)
    velocity_forces: list[Curve] = field(default_factory=list)
    friction_forces: list[FrictionCurve] = field(default_factory=list)
    hysteresis: list[tuple[float, float]] = field(default_factory=list)
    coupled_mass: float = 0.0
    bases: list[Base] = field(default_factory=list)
    forward: float = 1.0
    backward: float = 1.0
    table_factors: list[Surface] = field(default_factory=list)
    time_factors: list[Curve] = field(default_factory=list)

    @property
    def has_motor_factor(self) -> bool:
        """Whether the force on the carriage is not the measured one."""
        return self.gain != 1.0 or math.isfinite(self.saturation) or bool(self.gains)

    @property
    def has_forces(self) -> bool:
        """Whether there are disturbance forces."""
        return bool(
            self.forces
            or self.velocity_forces
            or self.friction_forces
            or self.hysteresis
            or self.coupled_mass
            or self.bases
        )

    @property
    def has_coulomb_factor(self) -> bool:
        """Whether Fc differs from place to place, in time, or between the directions."""
        return bool(self.table_factors or self.time_factors or self.forward != self.backward)


def known_figures(terms: KnownTerms, friction: FrictionFigures) -> FrictionFigures:
    """The figures with known ratios; C/Fc stays, and what the law does not have stays 0."""
    alpha = friction.static_ratio if terms.static_ratio is None else terms.static_ratio
    return replace(
        friction,
        coulomb=friction.coulomb * terms.coulomb,
        viscous=friction.viscous * terms.viscous,
        stiffness=friction.stiffness * terms.stiffness,
        static_ratio=alpha,
    )
