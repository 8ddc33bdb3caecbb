"""Friction that grows with the force that a transmission carries."""

from hil_sim.effects import Compensation, Effect, EffectPorts, Values, shape, size


class LoadFriction(Effect):
    """Gears and screws rub the harder the more force they carry.

    Teeth, rollers and nuts are pressed together by the force that they transmit, of either sign: a
    weight, an acceleration or a process force costs a share of itself. From a hundredth (ball
    screw) to a third (worm, harmonic drive). The motor's own inertia is on the near side.
    """

    group = "friction"
    transmission = True
    parameters = (
        size("ratio", "", "friction per transmitted force", (0.03, 0.3), least=0.0, below=1.0),
        shape(
            "motor_share", "", "share of the mass that is the motor's own", (0.05, 0.7),
            least=0.0, below=1.0,
        ),
    )  # fmt: skip
    equation = "Fc += ratio * abs(F_motor - F_f - motor_share m dv/dt)"
    enters = "A part of Fc that follows the force transmitted to the load."
    remedy = (
        "Check lubricant and preload of gear or screw; feed friction forward with a part "
        "proportional to the planned load force."
    )
    compensation = Compensation("the host's friction does not follow the load")

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.press(parameters["ratio"], parameters["motor_share"])
