"""Moved mass that differs from the machine file."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, mass
from hil_sim.settings import AxisSettings


class PayloadMass(Effect):
    """The carriage is heavier or lighter than the machine file says.

    A heavier chuck, a wafer cassette left on the table, a different optics head, a cover or cable
    chain that was not weighed, or a mass from CAD before the last change.
    """

    group = "mass"
    parameters = (mass("added to the moved mass", (0.03, 0.15)),)
    equation = "m + mass (may be negative)"
    enters = "The moved mass m."
    remedy = (
        "Weigh the load or identify the mass from accelerations, and correct it in the "
        "machine file; the feedforward uses it."
    )
    compensation = Compensation("in the mass of the feedforward", HOST)
    any_size = True

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.mass += parameters["mass"]

    def refusal(self, parameters: Values, axis: AxisSettings) -> str | None:
        """See `Effect.refusal`."""
        if parameters["mass"] <= -axis.mass:
            return f"mass: leaves no mass of the axis' {axis.mass:g} kg"
        return None
