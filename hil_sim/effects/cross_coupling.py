"""Force from the acceleration of the other axis."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, mass


class CrossCoupling(Effect):
    """Accelerating one axis pushes the other.

    Axes that are not square, a centre of mass off the line of thrust, a stacked stage with a
    compliant guide, or a force vector tilted by commutation.
    """

    group = "dynamics"
    parameters = (mass("force per acceleration of the other axis", (0.015, 0.05)),)
    equation = "F_d += mass * acceleration of the other axis"
    enters = "A disturbance force from the acceleration of the other axis, solved jointly with it."
    remedy = (
        "Feed the demanded acceleration of the other axis forward with this mass; square the axes "
        "and balance the load."
    )
    compensation = Compensation("fed forward from the other axis' demanded acceleration", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.couple(parameters["mass"])
