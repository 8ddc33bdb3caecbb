"""The weight of what a rotary axis carries."""

import numpy as np

from hil_sim.effects import FED_FORWARD, Effect, EffectPorts, Values, phase, size
from hil_sim.settings import AxisSettings


class Unbalance(Effect):
    """The centre of mass of arm or table is not on the axis of rotation, which is not vertical.

    The links and the load of a robot, a workpiece clamped off-centre, a counterweight that does
    not match: a torque with one period per turn.
    """

    group = "force"
    transmission = True
    parameters = (
        size(
            "torque", "N m", "largest torque of the weight", (0.02, 1.0), relative_to="rated force"
        ),
        phase(),
    )
    equation = "F_d += torque sin(x + phase), rotary axes only"
    enters = "A disturbance torque over the angle of a rotary axis."
    remedy = "Balance the load, or feed the torque of its weight forward over the angle."
    compensation = FED_FORWARD
    any_size = True

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        angle = ports.positions + parameters["phase"]
        ports.add_position_force(parameters["torque"] * np.sin(angle))

    def refusal(self, parameters: Values, axis: AxisSettings) -> str | None:
        """See `Effect.refusal`."""
        return None if axis.rotary else f"axis {axis.name} is not rotary"
