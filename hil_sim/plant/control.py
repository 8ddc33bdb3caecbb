"""The virtual drive's loops, one control tick at a time, compiled.

Position loop: PID on the encoder with a low-passed derivative, plus force offset, clamped to the
peak force; the integrator stops while clamped (docs/reference/reference-stage.md, "The drive, each
control tick"). Or a cascade, as in drives with a velocity loop (and in the EMPS benchmark): the
output of a proportional position loop is the setpoint of a PI loop on the encoder's velocity. The
current loop, a first-order lag, is integrated with the plant.
"""

from __future__ import annotations

import numpy as np

from stagedata.compiled import kernel
from stagedata.fields import of_type

LOOP_FIGURES = ("kp", "ki", "kd", "derivative_time", "peak_force")
"""Of `ControlSettings`."""
CASCADE_FIGURES = ("position_gain", "velocity_integral", "feedforward", "span")
"""Of `CascadeSettings`."""
CONTROL_DTYPE = np.dtype(
    [*of_type("f8", *LOOP_FIGURES, *CASCADE_FIGURES), ("cascaded", "?")], align=True
)
HELD_AT_POSITION = (
    "demand", "from_position", "to_position", "reading", "reading_before", "last_demand",
)  # fmt: skip
"""Fields of the state that are set to the encoder's reading when the loop is closed."""
_FORCES = (
    "offset", "from_force", "to_force", "integral", "derivative", "last_error", "output",
)  # fmt: skip
_RAMP = ("ramp_ticks", "ramp_done")
SET_TO_ZERO = (*_FORCES, *_RAMP)
"""Fields that are set to 0 then."""
CONTROL_STATE_DTYPE = np.dtype(
    [
        *of_type("?", "powered", "open"),
        *of_type("f8", *HELD_AT_POSITION, *_FORCES),
        *of_type("i8", *_RAMP),
    ],
    align=True,
)


@kernel()
def run_loop(control, loop, state, period):  # type: ignore[no-untyped-def]
    """One control tick: advance the demand and, under power, run the position loop.

    Args:
        control: record of the axis.
        loop: state of the loop.
        state: state of the axis.
        period: Tc [s].
    """
    advance_demand(loop)
    if loop.powered:
        error = position_loop(control, loop, state.encoder, period)
        state.worst_error = max(state.worst_error, abs(error))


@kernel()
def advance_demand(loop):  # type: ignore[no-untyped-def]
    """Advance one tick on the linear ramp to the pair commanded last [m, N]."""
    if loop.ramp_done >= loop.ramp_ticks:
        return
    loop.ramp_done += 1
    share = loop.ramp_done / loop.ramp_ticks
    loop.demand = loop.from_position + (loop.to_position - loop.from_position) * share
    loop.offset = loop.from_force + (loop.to_force - loop.from_force) * share


@kernel()
def cascade(control, loop, encoder, period):  # type: ignore[no-untyped-def]
    """One tick of a P position loop over a PI velocity loop, whose gain is `kd`.

    Args:
        control: record of the axis.
        loop: state of the axis.
        encoder: reading [m].
        period: Tc [s].

    Returns:
        The following error [m].
    """
    error = loop.demand - encoder
    before = loop.reading_before if control.span == 2 else loop.reading
    rate = (encoder - before) / (control.span * period)
    loop.derivative += period / (control.derivative_time + period) * (rate - loop.derivative)
    wanted = control.position_gain * error
    wanted += control.feedforward * (loop.demand - loop.last_demand) / period
    loop.reading_before = loop.reading
    loop.reading = encoder
    loop.last_demand = loop.demand
    missing = wanted - loop.derivative
    raw = control.kd * missing + loop.integral + loop.offset
    _limit(control, loop, raw, missing, control.velocity_integral * missing * period)
    return error


@kernel()
def _limit(control, loop, raw, error, grown):  # type: ignore[no-untyped-def]
    """Clamp the output to the peak force; the integrator stops while clamped.

    `raw`: output wanted [N]; `error`: what the integrator adds up; `grown`: what it adds now [N].
    """
    loop.output = min(max(raw, -control.peak_force), control.peak_force)
    if raw == loop.output or (raw > loop.output) != (error > 0.0):
        loop.integral += grown


@kernel()
def position_loop(control, loop, encoder, period):  # type: ignore[no-untyped-def]
    """One tick of the loop: set `output` [N], return the following error [m].

    Args:
        control: record of the axis.
        loop: state of the axis.
        encoder: reading [m].
        period: Tc [s].
    """
    if loop.open:  # force as commanded; the demand follows the axis
        loop.demand = encoder
        loop.output = min(max(loop.offset, -control.peak_force), control.peak_force)
        return 0.0
    if control.cascaded:
        return cascade(control, loop, encoder, period)
    error = loop.demand - encoder
    rate = (error - loop.last_error) / period
    loop.last_error = error
    loop.derivative += period / (control.derivative_time + period) * (rate - loop.derivative)
    raw = control.kp * error + loop.integral + control.kd * loop.derivative + loop.offset
    _limit(control, loop, raw, error, control.ki * error * period)
    return error
