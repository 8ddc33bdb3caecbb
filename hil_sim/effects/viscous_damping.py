"""Viscous friction that differs from the machine file."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class ViscousDamping(Effect):
    """Friction that grows with speed is stronger or weaker.

    Lubricant viscosity (which halves within about 20 K), churning of fresh grease, eddy currents in
    conductive parts near the magnets, or air squeezed through narrow gaps.
    """

    name = "viscous_damping"
    group = "friction"
    parameters = (
        Parameter(
            "ratio",
            "",
            "viscous coefficient over the nominal one",
            (0.3, 2.2),
            neutral=1.0,
            above=0.0,
        ),
    )
    equation = "sigma_v * ratio"
    enters = "The coefficient sigma_v."
    remedy = (
        "Re-identify sigma_v from moves at several speeds; if the lubricant causes it, warm the "
        "axis up before production."
    )
    compensation = Compensation(
        "in the figures that the host starts from",
        "estimation.known_effects.inverses:viscous_damping",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.viscous *= parameters["ratio"]
