"""A constant force on the axis."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ForceOffset(Effect):
    """A constant force pulls in one direction, whatever the axis does.

    A table out of level (1 mrad is 0.08 N for 8 kg), the pull of a cable or hose, a wrong
    counterbalance, a current sensor's offset.
    """

    name = "force_offset"
    group = "force"
    parameters = (
        Parameter(
            "force",
            "N",
            "force against positive motion",
            (0.06, 0.3),
            signed=True,
            relative_to="Coulomb force",
            neutral=0.0,
        ),
    )
    equation = "F_d += force (tilt, cable pull)"
    enters = "A constant disturbance force."
    remedy = "Level the machine, route cables and hoses without pull, or feed the force forward."
    compensation = Compensation(
        "fed forward, and kept apart from friction at rest",
        "estimation.known_effects.inverses:force_offset",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.force += parameters["force"]
