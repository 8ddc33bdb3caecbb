"""A constant force on the axis."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, force


class ForceOffset(Effect):
    """A constant force pulls in one direction, whatever the axis does.

    A table out of level (1 mrad is 0.08 N for 8 kg), the pull of a cable or hose, a wrong
    counterbalance, a current sensor's offset.
    """

    group = "force"
    parameters = (force("force", "force against positive motion", (0.06, 0.3), signed=True),)
    equation = "F_d += force (tilt, cable pull)"
    enters = "A constant disturbance force."
    remedy = "Level the machine, route cables and hoses without pull, or feed the force forward."
    compensation = Compensation("fed forward, and kept apart from friction at rest", HOST)
    any_size = True

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.force += parameters["force"]
