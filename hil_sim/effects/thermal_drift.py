"""Friction that falls while the axis warms up."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, shape, size


class ThermalDrift(Effect):
    """Friction is high at first and settles.

    Grease is stiff when cold and is warmed by its own losses within minutes; motor heat reaches the
    guides later; after a long rest the lubricant film recovers within seconds.
    """

    group = "friction"
    parameters = (
        size("amplitude", "", "increase at t = 0", (0.1, 0.4), least=-1.0),
        shape("time_constant", "s", "time constant of its decay", (3.0, 300.0), above=0.0),
    )
    equation = "Fc * (1 + amplitude exp(-t/time_constant))"
    enters = "A factor on Fc over time."
    remedy = "Warm the axis up before production, or track the friction level from move to move."
    compensation = Compensation(
        "a factor on the Coulomb force of the friction model over time", HOST
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.decay_coulomb(parameters["amplitude"], parameters["time_constant"])
