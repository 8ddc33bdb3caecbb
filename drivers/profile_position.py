"""One point-to-point move of one axis by the drive's own profile (mode pp).

Set-point handshake: target first, then the rising edge of bit 4; the drive raises bit 12; bit 4
goes down; the drive lowers bit 12; bit 10 must have been low before it is believed.
"""

from __future__ import annotations

from drivers import objects as od
from drivers.channel import Channel
from drivers.cia402 import Command, Control, State, Status
from drivers.cycle import Cycle
from drivers.errors import AxisFault
from drivers.power import Cycles, fault, state_of

HANDSHAKE_TIMEOUT = 0.5
NEAR = 5e-6
"""A drive that never acknowledges is believed to have begun when it moved this far [m]."""
SETTLING_TIMEOUT = 2.0
"""Beyond the profile's own duration [s]."""


def move(cycle: Cycle, channel: Channel, target: int, duration: float, period: float) -> None:
    """Moves an enabled axis in mode pp and returns when the target is reached.

    Args:
        cycle: the cyclic path.
        channel: the axis.
        target: absolute [increments].
        duration: of the profile [s], for the timeout.
        period: Ts [s].

    Raises:
        AxisFault: the handshake or the target stays away, or the axis faults.
    """
    enabled = int(Command.ENABLE_OPERATION | Control.CHANGE_IMMEDIATELY)
    channel.target, channel.offset, channel.controlword = target, 0, enabled
    _wait(
        cycle, channel, Status.SETPOINT_ACKNOWLEDGED, False, HANDSHAKE_TIMEOUT, period, "is ready"
    )
    channel.controlword = enabled | int(Control.NEW_SETPOINT)
    before = channel.position
    try:
        _wait(
            cycle, channel, Status.SETPOINT_ACKNOWLEDGED, True, HANDSHAKE_TIMEOUT, period, "takes"
        )
    except AxisFault as unanswered:
        # Some drives move without acknowledging; one that does neither has not taken it.
        near = round(NEAR / channel.axis.scale.increment)
        moved = abs(channel.position - before) > near or abs(channel.position - target) <= near
        if not moved or state_of(channel) is not State.OPERATION_ENABLED:
            raise unanswered
        channel.axis.limited(
            "statusword bit 12 in pp is not offered: set-points are not acknowledged"
        )
    channel.controlword = enabled
    _wait(
        cycle, channel, Status.SETPOINT_ACKNOWLEDGED, False, HANDSHAKE_TIMEOUT, period, "releases"
    )
    limit = duration + SETTLING_TIMEOUT
    _wait(cycle, channel, Status.TARGET_REACHED, True, limit, period, "reaches")


def _wait(
    cycle: Cycle,
    channel: Channel,
    bit: Status,
    level: bool,
    timeout: float,
    period: float,
    verb: str,
) -> None:
    for _ in Cycles(cycle, timeout, period, blind=False):
        if not channel.valid:
            continue
        if state_of(channel) is not State.OPERATION_ENABLED:
            raise fault(channel, "stopped during a profile move")
        if bool(channel.statusword & bit) is level:
            return
    raise AxisFault(
        f"no drive that {verb} set-point {channel.target} within {timeout:g} s "
        f"(statusword 0x{channel.statusword:04X})",
        axis=channel.axis.name, obj=od.TARGET_POSITION,
    )  # fmt: skip
