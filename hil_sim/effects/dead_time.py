"""A delay between controller and current loop."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class DeadTime(Effect):
    """The controller's output takes effect later than believed.

    PWM and computing delays, a controller and a power stage that talk over a bus, an
    interpolator or filter with a constant group delay.
    """

    name = "dead_time"
    group = "motor"
    parameters = (
        Parameter(
            "delay",
            "s",
            "of the controller's output",
            (0.2e-3, 0.8e-3),
            neutral=0.0,
            least=0.0,
            below=0.05,
        ),
    )
    equation = "u reaches the current loop this much later"
    enters = (
        "The controller's output waits before the current loop; fractions of a control tick count."
    )
    remedy = (
        "Shorten the chain (cycle times, filters); feed forward ahead by the delay and lower "
        "the loop gains if margins are thin."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.delay += parameters["delay"]
