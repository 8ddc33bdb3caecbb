"""Presliding stiffness that differs from the machine file."""

from hil_sim.effects import STARTED_WITH, Effect, EffectPorts, Values, factor


class PreslidingStiffness(Effect):
    """Friction is softer or stiffer in small motion, before it slides.

    The contact stiffness of rolling elements and raceways changes with preload and wear; seals and
    wipers add compliance; surface and lubricant film determine the presliding distance.
    """

    group = "friction"
    parameters = (factor("presliding stiffness over the nominal one", (0.4, 2.2)),)
    equation = "sigma0 * ratio"
    enters = "The stiffness sigma0 of the Maxwell-slip elements."
    remedy = (
        "Re-identify sigma0 from micro-moves and reversals; if it has fallen, check preload and "
        "wear of the guide."
    )
    compensation = STARTED_WITH

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`; a friction law without presliding is a ValueError."""
        if not (friction := ports.axis.friction).has("stiffness"):
            raise ValueError(f"the friction law {friction.law} has no presliding stiffness")
        ports.stiffness *= parameters["ratio"]
