"""Moved mass that differs from the machine file."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings


class PayloadMass(Effect):
    """The carriage is heavier or lighter than the machine file says.

    A heavier chuck, a wafer cassette left on the table, a different optics head, a cover or cable
    chain that was not weighed, or a mass from CAD before the last change.
    """

    name = "payload_mass"
    group = "mass"
    parameters = (
        Parameter(
            "mass",
            "kg",
            "added to the moved mass",
            (0.03, 0.15),
            signed=True,
            relative_to="mass",
            neutral=0.0,
        ),
    )
    equation = "m + mass (may be negative)"
    enters = "The moved mass m."
    remedy = (
        "Weigh the load or identify the mass from accelerations, and correct it in the "
        "machine file; the feedforward uses it."
    )
    compensation = Compensation(
        "in the mass of the feedforward",
        "estimation.known_effects.inverses:payload_mass",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.mass += parameters["mass"]

    def refusal(self, parameters: Mapping[str, float], axis: AxisSettings) -> str | None:
        """See `Effect.refusal`."""
        if parameters["mass"] <= -axis.mass:
            return f"mass: leaves no mass of the axis' {axis.mass:g} kg"
        return None
