"""An encoder's error over position as a table: a description of what is left over."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from hil_sim.effects import Compensation, Effect, EffectPorts, Parameter
from hil_sim.effects.residual_table import refuse_nodes
from hil_sim.settings import AxisSettings

_STEEPEST = 1.0
"""Largest change of the error per change of position: beyond it, readings can stand or go back."""


class MisreadingTable(Effect):
    """The encoder reads too much here, too little there, as measured and not understood.

    Like `residual_table` it is a description and no cause.
    """

    group = "dynamics"
    parameters = (
        Parameter("position", "m", "nodes over position, increasing", role="table"),
        Parameter("error", "m", "what is read too much at each of them", role="table"),
    )
    equation = "x_read = x + error(x); a cubic spline through the nodes"
    enters = "An error of the encoder's reading over position."
    remedy = "Calibrate the scale against an interferometer; clean scale and head."
    compensation = Compensation("it is a description, and the drive reads the encoder itself")
    searched = False

    def apply(self, ports: EffectPorts, parameters: Mapping[str, Any]) -> None:
        """See `Effect.apply`. The table is held at its ends."""
        places = np.array(parameters["position"])
        spline = CubicSpline(places, parameters["error"], bc_type="clamped")
        ports.add_misreading(spline(np.clip(ports.positions, places[0], places[-1])))

    def refusal(self, parameters: Mapping[str, Any], axis: AxisSettings) -> str | None:
        """See `Effect.refusal`: a table that does not fit its nodes, or is too steep."""
        unfit = refuse_nodes(parameters, "position", "error")
        if unfit is not None:
            return unfit
        slopes = np.diff(parameters["error"]) / np.diff(parameters["position"])
        steepest = float(np.abs(slopes).max())
        if steepest > _STEEPEST:
            return f"error: changes by {steepest:.3g} m per m, at most {_STEEPEST:g}"
        return None
