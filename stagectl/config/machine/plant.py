"""The models of an axis' mechanics in a machine file: mass and friction."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from stagectl.config.machine.plausible import Plausible
from stagectl.config.parsing.units import (
    NotNegativeDamping,
    NotNegativeNumber,
    Number,
    PositiveForce,
    PositiveForceRate,
    PositiveMass,
    PositiveNumber,
    PositiveStiffness,
    PositiveTime,
    PositiveVelocity,
)
from stagectl.config.parsing.validation import Section
from stagedata import MAX_ELEMENTS, FrictionFigures, LawName


class Repeatability(Section):
    """Random variation of the Coulomb force: relative rms, correlation time [s]."""

    coulomb: Annotated[NotNegativeNumber, Plausible(0.0, 1.0)] = 0.0
    correlation_time: Annotated[PositiveTime, Plausible(1e-9, 1e12, "s")] = 0.5


class Friction(Section):
    """Friction figures with their law, in the symbols of docs/reference-stage.md.

    Attributes:
        model: name of the law; which figures it has, `stagectl.config.machine.checks` sees to.
        elements: N.  coulomb: Fc [N].  static_ratio: alpha = (Fs - Fc)/Fc, > -1.
        stribeck_velocity: vs [m/s].  stribeck_shape: delta.  stiffness: sigma0 [N/m].
        attraction: C [N/s].  viscous: sigma_v [N s/m].
    """

    model: LawName
    elements: Annotated[int, Field(ge=1, le=MAX_ELEMENTS)] | None = None
    coulomb: Annotated[PositiveForce, Plausible(1e-12, 1e9, "N")]
    static_ratio: Annotated[Number, Field(gt=-1), Plausible(-1.0, 1e3)]
    stribeck_velocity: Annotated[PositiveVelocity, Plausible(1e-12, 1e6, "m/s")]
    stribeck_shape: Annotated[PositiveNumber, Plausible(1e-3, 1e3)]
    stiffness: Annotated[PositiveStiffness | None, Plausible(1e-9, 1e15, "N/m")] = None
    attraction: Annotated[PositiveForceRate | None, Plausible(1e-12, 1e15, "N/s")] = None
    viscous: Annotated[NotNegativeDamping, Plausible(0.0, 1e12, "N s/m")]
    repeatability: Repeatability = Repeatability()

    @property
    def figures(self) -> FrictionFigures:
        """The figures as simulator and estimator take them."""
        return FrictionFigures(
            elements=self.elements or 0,
            coulomb=self.coulomb,
            viscous=self.viscous,
            stiffness=self.stiffness or 0.0,
            relaxation_rate=(self.attraction or 0.0) / self.coulomb,
            static_ratio=self.static_ratio,
            stribeck_velocity=self.stribeck_velocity,
            stribeck_shape=self.stribeck_shape,
            law=self.model,
        )


class Plant(Section):
    """The mechanics; `tolerance` is the uncertainty of the parameters (relative, 1 sigma)."""

    tolerance: Annotated[NotNegativeNumber, Field(lt=1)]
    mass: Annotated[PositiveMass, Plausible(1e-9, 1e9, "kg")]
    friction: Friction
