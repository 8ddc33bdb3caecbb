"""A place on the travel with more friction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import EffectPorts


class FrictionPosition(Effect):
    """Friction is higher around one position.

    Contamination or damage of the rail, a dent from transport, a joint between two rails, dried
    lubricant where the carriage seldom goes, a pinched seal.
    """

    name = "friction_position"
    group = "friction"
    parameters = (
        Parameter("amplitude", "", "increase at the center", (0.2, 0.6), neutral=0.0, least=-1.0),
        Parameter("center", "m", "position of the center", None, role="place"),
        Parameter(
            "width",
            "m",
            "standard deviation of the bell curve",
            (1.0 / 60.0, 1.0 / 12.0),
            role="shape",
            relative_to="travel",
            least=5e-4,
            log=True,
        ),
    )
    equation = "Fc * (1 + amplitude exp(-((x - center)/width)²/2))"
    enters = "A factor on Fc over position."
    remedy = (
        "Clean and relubricate there; if it remains, use a friction map in the feedforward and "
        "plan to replace the rail."
    )
    compensation = Compensation(
        "a factor on the Coulomb force of the friction model along the planned path",
        "estimation.known_effects.inverses:friction_position",
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        bell = np.exp(-0.5 * ((ports.positions - parameters["center"]) / parameters["width"]) ** 2)
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * bell)
