"""Cables and hoses that act as a spring."""

from hil_sim.effects import FED_FORWARD, Effect, EffectPorts, Values, place, size


class CableStiffness(Effect):
    """The cable loop pulls towards the position where it is relaxed.

    Bending stiffness of cable chains, flat cables and vacuum hoses; also bellows and flexures;
    strongest on short travels and light stages.
    """

    group = "force"
    parameters = (
        size(
            "stiffness",
            "N/m",
            "stiffness of the spring",
            (0.3, 1.4),
            relative_to="Coulomb force over the travel",
        ),
        place("center", "position where it is relaxed"),
    )
    equation = "F_d += stiffness (x - center)"
    enters = "A disturbance force proportional to position."
    remedy = "Route the cables in a longer, softer loop, or feed the spring force forward."
    compensation = FED_FORWARD

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.spring += parameters["stiffness"]
        ports.force -= parameters["stiffness"] * parameters["center"]
