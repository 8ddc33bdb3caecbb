"""A loss of motor force over motor force as a table: a description of what is left over."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil_sim.effects import Compensation, Effect, EffectPorts, Parameter
from hil_sim.effects.residual_table import refuse_nodes
from hil_sim.settings import AxisSettings

_STEEPEST = 1.0 + 1e-9
"""Largest share of a change of the motor force that may be lost: all of it, as in a dead zone."""


class MotorLossTable(Effect):
    """Part of the motor force is lost, as measured and not understood: a dead zone, for example.

    Like `residual_table` it is a description and no cause.
    """

    group = "motor"
    parameters = (
        Parameter("motor_force", "N", "nodes over motor force, increasing", role="table"),
        Parameter("loss", "N", "force that is lost at each of them", role="table"),
    )
    equation = "F_motor -= loss(F_motor); linear between nodes"
    enters = "A loss over the measured motor force."
    remedy = "Find the cause: current offsets, dead time of the bridge, a loose coupling."
    compensation = Compensation("it is a description, and no inverse of it is made")
    searched = False

    def apply(self, ports: EffectPorts, parameters: Mapping[str, Any]) -> None:
        """See `Effect.apply`. The table is held at its ends."""
        at, loss = parameters["motor_force"], parameters["loss"]
        ports.lose_motor_force(np.interp(ports.motor_forces, at, loss))

    def refusal(self, parameters: Mapping[str, Any], axis: AxisSettings) -> str | None:
        """See `Effect.refusal`: a table that does not fit its nodes, or loses all of a change."""
        unfit = refuse_nodes(parameters, "motor_force", "loss")
        if unfit is not None:
            return unfit
        slope = float((np.diff(parameters["loss"]) / np.diff(parameters["motor_force"])).max())
        if slope > _STEEPEST:
            return f"loss: rises by {slope:.3g} N per N, at most 1"
        return None
