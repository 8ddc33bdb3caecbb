"""Presliding stiffness that differs from the machine file."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class PreslidingStiffness(Effect):
    """Friction is softer or stiffer in small motion, before it slides.

    The contact stiffness of rolling elements and raceways changes with preload and wear; seals and
    wipers add compliance; surface and lubricant film determine the presliding distance.
    """

    name = "presliding_stiffness"
    group = "friction"
    parameters = (
        Parameter(
            "ratio",
            "",
            "presliding stiffness over the nominal one",
            (0.4, 2.2),
            neutral=1.0,
            above=0.0,
        ),
    )
    equation = "sigma0 * ratio"
    enters = "The stiffness sigma0 of the Maxwell-slip elements."
    remedy = (
        "Re-identify sigma0 from micro-moves and reversals; if it has fallen, check preload and "
        "wear of the guide."
    )
    compensation = Compensation(
        "in the figures that the host starts from",
        "estimation.known_effects.inverses:presliding_stiffness",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`; a friction law without presliding is a ValueError."""
        if not (friction := ports.axis.friction).has("stiffness"):
            raise ValueError(f"the friction law {friction.law} has no presliding stiffness")
        ports.stiffness *= parameters["ratio"]
