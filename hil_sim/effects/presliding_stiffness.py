"""Stiffness of friction before it slips other than believed."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class PreslidingStiffness(Effect):
    """Friction yields sooner or later under small motion.

    Contact stiffness of rolling elements and raceways changes with preload and wear; seals and
    wipers add a soft branch; stick length depends on surface and lubricant film.
    """

    name = "presliding_stiffness"
    group = "friction"
    parameters = (
        Parameter("ratio", "", "of the presliding stiffness", (0.4, 2.2), neutral=1.0, above=0.0),
    )
    equation = "sigma0 * ratio"
    enters = "The stiffness sigma0 of the Maxwell-slip elements."
    remedy = (
        "Re-identify sigma0 from micro-moves and reversals; if it fell, check preload and "
        "wear of the guide."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.stiffness *= parameters["ratio"]
