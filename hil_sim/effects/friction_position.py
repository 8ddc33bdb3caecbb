"""A place on the travel with more friction."""

import numpy as np

from hil_sim.effects import FRICTION_FACTOR, Effect, EffectPorts, Values, place, shape, size


class FrictionPosition(Effect):
    """Friction is higher around one position.

    Contamination or damage of the rail, a dent from transport, a joint between two rails, dried
    lubricant where the carriage seldom goes, a pinched seal.
    """

    group = "friction"
    parameters = (
        size("amplitude", "", "increase at the center", (0.2, 0.6), least=-1.0),
        place("center", "position of the center"),
        shape(
            "width",
            "m",
            "standard deviation of the bell curve",
            (1.0 / 500.0, 1.0 / 12.0),
            relative_to="travel",
            least=2e-4,
        ),
    )
    equation = "Fc * (1 + amplitude exp(-((x - center)/width)²/2))"
    enters = "A factor on Fc over position."
    remedy = (
        "Clean and relubricate there; if it remains, use a friction map in the feedforward and "
        "plan to replace the rail."
    )
    compensation = FRICTION_FACTOR

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        bell = np.exp(-0.5 * ((ports.positions - parameters["center"]) / parameters["width"]) ** 2)
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * bell)
