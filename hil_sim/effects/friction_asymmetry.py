"""Coulomb friction that depends on the direction of motion."""

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Values, asymmetry


class FrictionAsymmetry(Effect):
    """Friction is stronger in one direction than in the other.

    Wiper lips that bend one way, a misaligned guide carriage, a cable chain that is pushed in one
    direction and pulled in the other, a ball recirculation that loads one side.
    """

    group = "friction"
    parameters = (asymmetry((0.06, 0.2)),)
    equation = "Fc * (1 + ratio sgn v)"
    enters = "A factor on Fc for each direction."
    remedy = (
        "Compensate with one level per direction; check the alignment of the carriages and the "
        "routing of the cable chain."
    )
    compensation = Compensation("one Coulomb force per direction in the friction model", HOST)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.coulomb_forward *= 1.0 + parameters["ratio"]
        ports.coulomb_backward *= 1.0 - parameters["ratio"]
