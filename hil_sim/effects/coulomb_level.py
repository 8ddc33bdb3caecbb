"""Coulomb friction that differs from the machine file."""

from hil_sim.effects import STARTED_WITH, Effect, EffectPorts, Values, factor


class CoulombLevel(Effect):
    """Sliding friction is stronger or weaker along the whole travel.

    Preload of guides, wipers or seals, new or aged lubricant, a different grease, a temperature
    other than at the last identification.
    """

    group = "friction"
    parameters = (factor("Coulomb level over the nominal one", (0.7, 1.3)),)
    equation = "Fc * ratio (C/Fc kept: C * ratio)"
    enters = "A factor on Fc, in the slip limits too; the relaxation rate C/Fc stays."
    remedy = (
        "Re-identify the friction level (a calibration move is enough); if it has risen, check "
        "lubrication, wipers and preload."
    )
    compensation = STARTED_WITH
    any_size = True

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.coulomb *= parameters["ratio"]
