"""Friction that falls while the axis warms up."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ThermalDrift(Effect):
    """Friction is high at first and settles.

    Grease is stiff when cold and is warmed by its own losses within minutes; motor heat reaches the
    guides later; after a long rest the lubricant film recovers within seconds.
    """

    name = "thermal_drift"
    group = "friction"
    parameters = (
        Parameter("amplitude", "", "increase at t = 0", (0.1, 0.4), neutral=0.0, least=-1.0),
        Parameter(
            "time_constant",
            "s",
            "time constant of its decay",
            (3.0, 300.0),
            role="shape",
            above=0.0,
            log=True,
        ),
    )
    equation = "Fc * (1 + amplitude exp(-t/time_constant))"
    enters = "A factor on Fc over time."
    remedy = "Warm the axis up before production, or track the friction level from move to move."
    compensation = Compensation(
        "a factor on the Coulomb force of the friction model over time",
        "estimation.known_effects.inverses:thermal_drift",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.decay_coulomb(parameters["amplitude"], parameters["time_constant"])
