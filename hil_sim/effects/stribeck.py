"""Static friction that differs from the machine file."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class Stribeck(Effect):
    """Breakaway takes a different force, relative to sliding, than the machine file says.

    Boundary lubrication after long rests, starved or over-greased guides, sliding seals; rolling
    guides with little lubricant show hardly any.
    """

    name = "stribeck"
    group = "friction"
    parameters = (
        Parameter(
            "static_ratio",
            "",
            "excess of static over sliding friction, alpha",
            (0.0, 1.2),
            neutral="static_ratio",
            above=-1.0,
        ),
    )
    equation = "alpha = static_ratio"
    enters = "Replaces the ratio alpha of the Stribeck curve s(v)."
    remedy = (
        "Re-identify alpha from slow reversals; if the peak is large, relubricate, run the guides "
        "in, or keep the axis moving between sites."
    )
    compensation = Compensation(
        "in the figures that the host starts from",
        "estimation.known_effects.inverses:stribeck",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.static_ratio = parameters["static_ratio"]
