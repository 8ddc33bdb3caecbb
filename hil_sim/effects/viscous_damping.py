"""Viscous friction that differs from the machine file."""

from hil_sim.effects import STARTED_WITH, Effect, EffectPorts, Values, factor


class ViscousDamping(Effect):
    """Friction that grows with speed is stronger or weaker.

    Lubricant viscosity (which halves within about 20 K), churning of fresh grease, eddy currents in
    conductive parts near the magnets, or air squeezed through narrow gaps.
    """

    group = "friction"
    parameters = (factor("viscous coefficient over the nominal one", (0.3, 2.2)),)
    equation = "sigma_v * ratio"
    enters = "The coefficient sigma_v."
    remedy = (
        "Re-identify sigma_v from moves at several speeds; if the lubricant causes it, warm the "
        "axis up before production."
    )
    compensation = STARTED_WITH
    any_size = True

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.viscous *= parameters["ratio"]
