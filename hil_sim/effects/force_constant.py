"""Motor force per current that differs from nominal."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, factor


class ForceConstant(Effect):
    """The motor force per ampere is not what the drive's scaling says.

    Warm magnets (NdFeB loses about 0.1 % per kelvin), an air gap that differs from the drawing, a
    wrong commutation angle, a current sensor's gain error, or a wrong rated force in the drive.
    """

    group = "motor"
    parameters = (factor("motor force over measured force", (0.9, 1.1)),)
    equation = "F_motor = ratio * measured current * nominal constant"
    enters = "A factor from measured force to motor force; the force actual value does not show it."
    remedy = (
        "Measure force against current with a load cell, check the commutation offset, and "
        "correct the drive's force scaling."
    )
    compensation = Compensation("the force demand is divided by it", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.force_constant *= parameters["ratio"]
