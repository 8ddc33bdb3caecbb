"""Coulomb friction that depends on the direction of motion."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class FrictionAsymmetry(Effect):
    """Friction is stronger in one direction than in the other.

    Wiper lips that bend one way, a misaligned guide carriage, a cable chain that is pushed in one
    direction and pulled in the other, a ball recirculation that loads one side.
    """

    name = "friction_asymmetry"
    group = "friction"
    parameters = (
        Parameter(
            "ratio",
            "",
            "half the difference between the directions over their mean",
            (0.06, 0.2),
            signed=True,
            neutral=0.0,
            above=-1.0,
            below=1.0,
        ),
    )
    equation = "Fc * (1 + ratio sgn v)"
    enters = "A factor on Fc for each direction."
    remedy = (
        "Compensate with one level per direction; check the alignment of the carriages and the "
        "routing of the cable chain."
    )
    compensation = Compensation(
        "one Coulomb force per direction in the friction model",
        "estimation.known_effects.inverses:friction_asymmetry",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.coulomb_forward *= 1.0 + parameters["ratio"]
        ports.coulomb_backward *= 1.0 - parameters["ratio"]
