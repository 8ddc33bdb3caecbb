"""The virtual drive's loops, one control tick at a time, compiled.

Position loop: PID on the encoder with a low-passed derivative, force offset added, output clamped
to the peak force, integrator halted while clamped (docs/reference-stage.md, "The drive, each
control tick"). The current loop, a first-order lag, is integrated with the plant.
"""

from __future__ import annotations

import numba
import numpy as np

CONTROL_DTYPE = np.dtype(
    [("kp", "f8"), ("ki", "f8"), ("kd", "f8"), ("derivative_time", "f8"), ("peak_force", "f8")]
)
CONTROL_STATE_DTYPE = np.dtype(
    [
        ("powered", "?"),
        ("demand", "f8"),
        ("offset", "f8"),
        ("from_position", "f8"),
        ("to_position", "f8"),
        ("from_force", "f8"),
        ("to_force", "f8"),
        ("ramp_ticks", "i8"),
        ("ramp_done", "i8"),
        ("integral", "f8"),
        ("derivative", "f8"),
        ("last_error", "f8"),
        ("output", "f8"),
    ],
    align=True,
)


@numba.njit(cache=True)
def advance_demand(loop):  # type: ignore[no-untyped-def]
    """Next point of the linear ramp between the last two commanded pairs."""
    if loop.ramp_done >= loop.ramp_ticks:
        return
    loop.ramp_done += 1
    share = loop.ramp_done / loop.ramp_ticks
    loop.demand = loop.from_position + (loop.to_position - loop.from_position) * share
    loop.offset = loop.from_force + (loop.to_force - loop.from_force) * share


@numba.njit(cache=True)
def position_loop(control, loop, encoder, period):  # type: ignore[no-untyped-def]
    """One tick of the PID; sets the clamped force demand, returns the following error [m]."""
    error = loop.demand - encoder
    rate = (error - loop.last_error) / period
    loop.last_error = error
    loop.derivative += period / (control.derivative_time + period) * (rate - loop.derivative)
    raw = control.kp * error + loop.integral + control.kd * loop.derivative + loop.offset
    loop.output = min(max(raw, -control.peak_force), control.peak_force)
    if raw == loop.output or (raw > loop.output) != (error > 0.0):
        loop.integral += control.ki * error * period
    return error
