"""Motor force that levels off at high current."""

from __future__ import annotations

import math
from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ForceSaturation(Effect):
    """At high current the force falls short of its demand.

    The iron of the coil unit or back plate saturates, the magnets are warm, or the supply voltage
    cannot drive the current at speed; most visible during acceleration.
    """

    name = "force_saturation"
    group = "motor"
    parameters = (
        Parameter(
            "force",
            "N",
            "force that the motor cannot exceed",
            (1.0, 1.8),
            relative_to="rated force",
            above=0.0,
            neutral=math.inf,
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
    compensation = Compensation(
        "the force demand is bent the other way",
        "estimation.known_effects.inverses:force_saturation",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.saturation = min(ports.saturation, parameters["force"])
