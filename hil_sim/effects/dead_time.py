"""A delay between controller and current loop."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class DeadTime(Effect):
    """The controller's output takes effect later than the machine file says.

    PWM and computing delays, a bus between controller and power stage, an interpolator or filter
    with a constant group delay.
    """

    name = "dead_time"
    group = "motor"
    parameters = (
        Parameter(
            "delay",
            "s",
            "delay of the controller's output",
            (0.2e-3, 0.8e-3),
            neutral=0.0,
            least=0.0,
            below=0.05,
        ),
    )
    equation = "u reaches the current loop after this delay"
    enters = (
        "Delays the controller's output before the current loop, in fractions of a control tick."
    )
    remedy = (
        "Shorten cycle times and filters; evaluate the feedforward ahead by the delay, and lower "
        "the loop gains if the margins are small."
    )
    compensation = Compensation(
        "the feedforward leads by it",
        "estimation.known_effects.inverses:dead_time",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.delay += parameters["delay"]
