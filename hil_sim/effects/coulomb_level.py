"""Coulomb friction that differs from the machine file."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class CoulombLevel(Effect):
    """Sliding friction is stronger or weaker along the whole travel.

    Preload of guides, wipers or seals, new or aged lubricant, a different grease, a temperature
    other than at the last identification.
    """

    name = "coulomb_level"
    group = "friction"
    parameters = (
        Parameter(
            "ratio", "", "Coulomb level over the nominal one", (0.7, 1.3), neutral=1.0, above=0.0
        ),
    )
    equation = "Fc * ratio (C/Fc kept: C * ratio)"
    enters = "A factor on Fc, in the slip limits too; the relaxation rate C/Fc stays."
    remedy = (
        "Re-identify the friction level (a calibration move is enough); if it has risen, check "
        "lubrication, wipers and preload."
    )
    compensation = Compensation(
        "in the figures that the host starts from",
        "estimation.known_effects.inverses:coulomb_level",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.coulomb *= parameters["ratio"]
