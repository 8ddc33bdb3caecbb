"""Cables and hoses that act as a spring."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class CableStiffness(Effect):
    """The cable loop pulls towards the position where it is relaxed.

    Bending stiffness of cable chains, flat cables and vacuum hoses; also bellows and flexures;
    strongest on short travels and light stages.
    """

    name = "cable_stiffness"
    group = "force"
    parameters = (
        Parameter(
            "stiffness",
            "N/m",
            "stiffness of the spring",
            (0.3, 1.4),
            relative_to="Coulomb force over the travel",
            neutral=0.0,
        ),
        Parameter("center", "m", "position where it is relaxed", None, role="place"),
    )
    equation = "F_d += stiffness (x - center)"
    enters = "A disturbance force proportional to position."
    remedy = "Route the cables in a longer, softer loop, or feed the spring force forward."
    compensation = Compensation(
        "fed forward along the planned path",
        "estimation.known_effects.inverses:cable_stiffness",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.spring += parameters["stiffness"]
        ports.force -= parameters["stiffness"] * parameters["center"]
