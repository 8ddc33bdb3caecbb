"""Friction in proportion to speed other than believed."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ViscousDamping(Effect):
    """The part of friction that grows with speed is stronger or weaker.

    Lubricant viscosity (which halves within some 20 K), churning grease after relubrication,
    eddy currents in conductive parts near the magnets, or air squeezed between narrow gaps.
    """

    name = "viscous_damping"
    group = "friction"
    parameters = (
        Parameter("ratio", "", "of the viscous coefficient", (0.3, 2.2), neutral=1.0, above=0.0),
    )
    equation = "sigma_v * ratio"
    enters = "The coefficient sigma_v."
    remedy = (
        "Re-identify sigma_v from moves at several speeds; warm the axis up before production "
        "if lubricant causes it."
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.viscous *= parameters["ratio"]
