"""Motor force that levels off at high current."""

import math

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, size


class ForceSaturation(Effect):
    """At high current the force falls short of its demand.

    The iron of the coil unit or back plate saturates, the magnets are warm, or the supply voltage
    cannot drive the current at speed; most visible during acceleration.
    """

    group = "motor"
    parameters = (
        size(
            "force",
            "N",
            "force that the motor cannot exceed",
            (1.0, 1.8),
            relative_to="rated force",
            neutral=math.inf,
            above=0.0,
            log=True,
        ),
    )
    equation = "F_motor = force * tanh(F/force)"
    enters = (
        "A soft limit on the motor force after the force constant; the force actual value "
        "does not show it."
    )
    remedy = (
        "Keep the acceleration below the force where the curve bends, or invert the curve in the "
        "force demand; check cooling and bus voltage."
    )
    compensation = Compensation("the force demand is bent the other way", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.saturation = min(ports.saturation, parameters["force"])
