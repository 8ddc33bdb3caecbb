"""Motor force that lags behind the measured one, as a table: a description of what is left over."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hil_sim.effects import Compensation, Effect, EffectPorts, Parameter
from hil_sim.settings import AxisSettings

_MOST = 100
_STEEPEST = 0.9
"""Largest share of a change of the motor force that may be lost right after it turns."""


class MotorHysteresisTable(Effect):
    """The motor force lags behind the measured one, as measured and not understood.

    Iron lags behind the current that magnetises it. Like `residual_table` it is a description and
    no cause.
    """

    group = "motor"
    parameters = (
        Parameter("width", "N", "change of motor force until each element slides", role="table"),
        Parameter("loss", "N", "force that each element loses then", role="table"),
    )
    equation = "F_motor -= sum of loss * s, ds = dF_motor / width, held within ± 1"
    enters = "Elements that slide as the measured motor force changes."
    remedy = "Find the cause: iron in the motor and its magnetisation; let the current turn slowly."
    compensation = Compensation("it is a description, and no inverse of it is made")
    searched = False

    def apply(self, ports: EffectPorts, parameters: Mapping[str, Any]) -> None:
        """See `Effect.apply`."""
        for width, loss in zip(parameters["width"], parameters["loss"], strict=True):
            ports.lag_motor_force(width, loss)

    def refusal(self, parameters: Mapping[str, Any], axis: AxisSettings) -> str | None:
        """See `Effect.refusal`: lists that do not fit each other, or lose too much of a change."""
        widths, losses = (np.array(parameters[key]) for key in ("width", "loss"))
        if not 1 <= len(widths) <= _MOST:
            return f"width: must have 1 to {_MOST} values, has {len(widths)}"
        if len(losses) != len(widths):
            return f"loss: must have {len(widths)} values like width, has {len(losses)}"
        if not (widths > 0.0).all():
            return "width: must be above 0"
        # From the turn on one element after the other slides, the narrowest first.
        slopes = np.cumsum((losses / widths)[np.argsort(-widths)])
        steepest = float(np.abs(slopes).max())
        if steepest > _STEEPEST:
            return f"loss: changes by {steepest:.3g} N per N, at most {_STEEPEST:g}"
        return None
