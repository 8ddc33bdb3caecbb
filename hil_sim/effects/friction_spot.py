"""A spot on the table with more friction."""

import numpy as np

from hil_sim.effects import FRICTION_FACTOR, Effect, EffectPorts, Values, place, shape, size
from hil_sim.effects.ports import POSITION_MARGIN


class FrictionSpot(Effect):
    """Friction is higher at one spot, given by the positions of both axes.

    Dirt or a drop of glue on the granite, passed by a bearing pad or carriage at this spot only; a
    cable that rubs in one corner.
    """

    group = "friction"
    parameters = (
        size("amplitude", "", "increase at the center", (0.05, 0.6), least=-0.9),
        place("center", "position of the center, this axis"),
        place("other", "position of the center, other axis"),
        shape("width", "m", "standard deviation of the bell curve", (5e-3, 25e-3), least=2e-3),
    )
    equation = "Fc * (1 + amplitude exp(-((x - center)² + (y - other)²)/width²/2))"
    enters = "A factor on Fc over the positions of both axes."
    remedy = "Clean the spot, then run `stagectl calibrate` to update the friction map."
    compensation = FRICTION_FACTOR
    searched = False  # along a path it is a `friction_position`

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        width = parameters["width"]
        low, high = ports.axis.travel
        count = int((high - low + 2.0 * POSITION_MARGIN) / (width / 8.0)) + 2
        nodes = np.linspace(low - POSITION_MARGIN, high + POSITION_MARGIN, count)
        own = np.exp(-0.5 * ((nodes - parameters["center"]) / width) ** 2)
        other = np.exp(-0.5 * ((nodes - parameters["other"]) / width) ** 2)
        ports.scale_field_coulomb(
            nodes, nodes, 1.0 + parameters["amplitude"] * own[:, None] * other[None, :]
        )
