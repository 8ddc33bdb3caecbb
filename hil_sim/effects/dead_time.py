"""A delay between controller and current loop."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, size


class DeadTime(Effect):
    """The controller's output takes effect later than the machine file says.

    PWM and computing delays, a bus between controller and power stage, an interpolator or filter
    with a constant group delay.
    """

    group = "motor"
    parameters = (
        size("delay", "s", "delay of the controller's output", (2e-4, 8e-4), least=0.0, below=0.05),
    )
    equation = "u reaches the current loop after this delay"
    enters = (
        "Delays the controller's output before the current loop, in fractions of a control tick."
    )
    remedy = (
        "Shorten cycle times and filters; evaluate the feedforward ahead by the delay, and lower "
        "the loop gains if the margins are small."
    )
    compensation = Compensation("the feedforward leads by it", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.delay += parameters["delay"]
