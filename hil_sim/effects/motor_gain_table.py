"""A factor on the motor force over position as a table: a description of what is left over."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil_sim.effects import HOST, Compensation, Effect, EffectPorts, Parameter
from hil_sim.effects.residual_table import refuse_nodes
from hil_sim.settings import AxisSettings


class MotorGainTable(Effect):
    """The motor is stronger here and weaker there, as measured and not understood.

    Like `residual_table` it is a description and no cause.
    """

    group = "motor"
    parameters = (
        Parameter("position", "m", "nodes over position, increasing", role="table"),
        Parameter("factor", "", "on the motor force at each of them", role="table", least=0.1),
    )
    equation = "F_motor * factor(x); linear between nodes"
    enters = (
        "A factor on the motor force over position, after saturation; the force actual value "
        "does not show it."
    )
    remedy = (
        "Find the cause: a weak magnet, a wrong commutation angle; until then, feed it forward."
    )
    compensation = Compensation("the force demand is divided by it along the planned path", HOST)
    searched = False

    def apply(self, ports: EffectPorts, parameters: Mapping[str, Any]) -> None:
        """See `Effect.apply`. The table is held at its ends."""
        at, factor = parameters["position"], parameters["factor"]
        ports.scale_position_gain(np.interp(ports.positions, at, factor))

    def refusal(self, parameters: Mapping[str, Any], axis: AxisSettings) -> str | None:
        """See `Effect.refusal`: a table that does not fit its nodes."""
        return refuse_nodes(parameters, "position", "factor")
