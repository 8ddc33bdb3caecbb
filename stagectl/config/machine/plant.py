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
    """Relative rms of the wander of Fc."""
    correlation_time: Annotated[PositiveTime, Plausible(1e-9, 1e12, "s")] = 0.5
    """Correlation time of the wander."""


class Friction(Section):
    """Friction figures with their law, in the symbols of docs/reference/reference-stage.md."""

    model: LawName
    """Friction law of the virtual stage and of the host's model: `gms`, generalized Maxwell slip,
    or `coulomb`, Coulomb and Stribeck friction without presliding."""
    elements: Annotated[int, Field(ge=1, le=MAX_ELEMENTS)] | None = None
    """Number N of Maxwell-slip elements; `gms` only."""
    coulomb: Annotated[PositiveForce, Plausible(1e-12, 1e9, "N")]
    """Fc: friction force of steady sliding without the viscous part."""
    static_ratio: Annotated[Number, Field(gt=-1), Plausible(-1.0, 1e3)]
    """(Fs - Fc)/Fc: relative surplus of the static friction."""
    stribeck_velocity: Annotated[PositiveVelocity, Plausible(1e-12, 1e6, "m/s")]
    """Speed vs at which that surplus fades."""
    stribeck_shape: Annotated[PositiveNumber, Plausible(1e-3, 1e3)]
    """Exponent delta with which it fades."""
    stiffness: Annotated[PositiveStiffness | None, Plausible(1e-9, 1e15, "N/m")] = None
    """Presliding stiffness sigma0; `gms` only."""
    attraction: Annotated[PositiveForceRate | None, Plausible(1e-12, 1e15, "N/s")] = None
    """Attraction parameter C: rate at which the force returns to its sliding value; `gms` only."""
    viscous: Annotated[NotNegativeDamping, Plausible(0.0, 1e12, "N s/m")]
    """Viscous force per speed, sigma_v."""
    repeatability: Repeatability = Repeatability()
    """How far Fc wanders by itself."""

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
    """The mechanics."""

    tolerance: Annotated[NotNegativeNumber, Field(lt=1)]
    """Relative uncertainty of the parameters below, 1 sigma: 0.003 is 0.3 %. Used by the host; a
    simulation takes the parameters as exact."""
    mass: Annotated[PositiveMass, Plausible(1e-9, 1e9, "kg")]
    """Moved mass."""
    friction: Friction
    """Friction of the guide; `friction: unknown` leaves all of it open ([machine
    files](../how-to/machine-file.md#unknown-figures))."""
