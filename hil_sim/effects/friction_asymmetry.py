"""Coulomb friction that differs between the directions."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class FrictionAsymmetry(Effect):
    """Friction one way is stronger than the other.

    Wiper lips with a grain, a guide carriage clamped askew, a cable chain that is pushed one
    way and pulled the other, a ball recirculation that loads on one side.
    """

    name = "friction_asymmetry"
    group = "friction"
    parameters = (
        Parameter(
            "ratio",
            "",
            "half the difference of the directions over their mean",
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
        "Compensate with a level per direction; check alignment of the carriages and the way "
        "the cable chain is led."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.coulomb_forward *= 1.0 + parameters["ratio"]
        ports.coulomb_backward *= 1.0 - parameters["ratio"]
