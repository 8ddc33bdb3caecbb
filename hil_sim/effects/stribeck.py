"""Static friction that differs from the machine file."""

from hil_sim.effects import STARTED_WITH, Effect, EffectPorts, Values, size


class Stribeck(Effect):
    """Breakaway takes a different force, relative to sliding, than the machine file says.

    Boundary lubrication after long rests, starved or over-greased guides, sliding seals; rolling
    guides with little lubricant show hardly any.
    """

    group = "friction"
    parameters = (
        size(
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
    compensation = STARTED_WITH

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.static_ratio = parameters["static_ratio"]
