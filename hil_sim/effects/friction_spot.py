"""A spot on the table with more friction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Compensation, Effect, Parameter
from hil_sim.effects.ports import POSITION_MARGIN, EffectPorts


class FrictionSpot(Effect):
    """Friction is higher at one spot, given by the positions of both axes.

    Dirt or a drop of glue on the granite, passed by a bearing pad or carriage at this spot only; a
    cable that rubs in one corner.
    """

    name = "friction_spot"
    group = "friction"
    parameters = (
        Parameter("amplitude", "", "increase at the center", (0.05, 0.6), neutral=0.0, least=-0.9),
        Parameter("center", "m", "position of the center, this axis", None, role="place"),
        Parameter("other", "m", "position of the center, other axis", None, role="place"),
        Parameter(
            "width", "m", "standard deviation of the bell curve", (5e-3, 25e-3), role="shape",
            least=2e-3, log=True,
        ),
    )  # fmt: skip
    equation = "Fc * (1 + amplitude exp(-((x - center)² + (y - other)²)/width²/2))"
    enters = "A factor on Fc over the positions of both axes."
    remedy = "Clean the spot, then run `stagectl calibrate` to update the friction map."
    compensation = Compensation(
        "a factor on the Coulomb force of the friction model along the planned path",
        "estimation.known_effects.inverses:friction_spot",
    )
    searched = False  # along a path it is a `friction_position`

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        width = parameters["width"]
        low, high = ports.axis.travel
        nodes = np.linspace(
            low - POSITION_MARGIN,
            high + POSITION_MARGIN,
            int((high - low + 2.0 * POSITION_MARGIN) / (width / 8.0)) + 2,
        )
        own = np.exp(-0.5 * ((nodes - parameters["center"]) / width) ** 2)
        other = np.exp(-0.5 * ((nodes - parameters["other"]) / width) ** 2)
        ports.scale_field_coulomb(
            nodes, nodes, 1.0 + parameters["amplitude"] * own[:, None] * other[None, :]
        )
