"""Point-to-point moves of one axis by the drive's own profile (mode pp).

Set-point handshake: target (with bits 5 and 6, which some drives want before bit 4) first, then the
rising edge of bit 4; the drive raises bit 12; bit 4 goes down; the drive lowers bit 12 when it can
take another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers import objects as od
from drivers.cyclic import Channel, Cycle
from drivers.drive import Command, Control, State, Status
from drivers.errors import AxisFault
from drivers.motion.power import Cycles, fault, state_of

HANDSHAKE_TIMEOUT = 0.5
NEAR = 5e-6
"""A drive that never acknowledges is believed to have begun when it moved this far [m]."""
SETTLING_TIMEOUT = 2.0
"""Beyond the profile's own duration [s]."""


@dataclass(frozen=True, slots=True)
class Setpoint:
    """One target of the drive's own profile.

    Attributes:
        target: absolute, or with `relative` from the target before [increments].
        end: where it leads to, absolute [increments].
        duration: of its profile [s], for the timeout.
        relative: controlword bit 6.
    """

    target: int
    end: int
    duration: float
    relative: bool = False


def move(cycle: Cycle, channel: Channel, setpoints: Sequence[Setpoint], period: float) -> None:
    """Moves an enabled axis in mode pp from target to target; returns when the last is reached.

    The first one acts at once (bit 5), the others queue: each is handed over as soon as the drive
    has room for it, and begins when the one before is done.

    Args:
        cycle: the cyclic path.
        channel: the axis.
        setpoints: one at least.
        period: Ts [s].

    Raises:
        AxisFault: a handshake or a target stays away, or the axis faults.
    """
    room, bits = HANDSHAKE_TIMEOUT, int(Control.CHANGE_IMMEDIATELY)
    for number, setpoint in enumerate(setpoints):
        acknowledged = hand_over(cycle, channel, setpoint, bits, room, period)
        if not acknowledged or number == len(setpoints) - 1:
            limit = room + setpoint.duration + SETTLING_TIMEOUT
            _reach(cycle, channel, setpoint, limit, period)
        room += setpoint.duration + SETTLING_TIMEOUT
        bits = 0
    if setpoints[-1].relative:  # what follows takes it for a place
        channel.target = channel.position


def hand_over(
    cycle: Cycle,
    channel: Channel,
    setpoint: Setpoint,
    bits: int,
    room: float,
    period: float,
    instead: bool = False,
) -> bool:
    """One handshake.

    Args:
        cycle: the cyclic path.
        channel: the axis.
        setpoint: what the drive is to take.
        bits: 5, 8 and 9 of the controlword.
        room: how long the drive may take to have room for it [s].
        period: Ts [s].
        instead: the drive has no room, and takes this one for what waits there.

    Returns:
        Whether the drive acknowledged.

    Raises:
        AxisFault: it did neither that nor move, or the axis faults.
    """
    word = int(Command.ENABLE_OPERATION) | bits
    if setpoint.relative:
        word |= int(Control.RELATIVE)
    ready = Status.SETPOINT_ACKNOWLEDGED
    channel.target, channel.offset, channel.controlword = setpoint.target, 0, word
    if instead:
        cycle.exchange()
    else:
        _wait(cycle, channel, ready, False, room, period, "is ready for")
    channel.controlword = word | int(Control.NEW_SETPOINT)
    before = channel.position
    acknowledged = True
    try:
        _wait(cycle, channel, ready, True, HANDSHAKE_TIMEOUT, period, "takes")
    except AxisFault as unanswered:
        # Some drives move without acknowledging; one that does neither has not taken it.
        near = round(NEAR / channel.axis.scale.increment)
        moved = (
            abs(channel.position - before) > near or abs(channel.position - setpoint.end) <= near
        )
        if not moved or state_of(channel) is not State.OPERATION_ENABLED:
            raise unanswered
        acknowledged = False
        channel.axis.limited(
            "statusword bit 12 in pp is not offered: set-points are not acknowledged"
        )
    channel.controlword = word
    if not acknowledged or bits & Control.CHANGE_IMMEDIATELY:
        _wait(cycle, channel, ready, False, HANDSHAKE_TIMEOUT, period, "releases")
    else:
        cycle.exchange()  # bit 12 stays while the queue is full
    return acknowledged


def _reach(
    cycle: Cycle, channel: Channel, setpoint: Setpoint, timeout: float, period: float
) -> None:
    """Waits for bit 10, which may still be the target's before: it counts once it was low.

    Or where the axis is: a move shorter than a SYNC period may never show it low.
    """
    near = round(NEAR / channel.axis.scale.increment)
    low = False
    for _ in Cycles(cycle, timeout, period, blind=False):
        if not channel.valid:
            continue
        if state_of(channel) is not State.OPERATION_ENABLED:
            raise fault(channel, "stopped during a profile move")
        if not channel.statusword & Status.TARGET_REACHED:
            low = True
        elif low or abs(channel.position - setpoint.end) <= near:
            return
    raise _timed_out(channel, "reaches", timeout)


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
    raise _timed_out(channel, verb, timeout)


def _timed_out(channel: Channel, verb: str, timeout: float) -> AxisFault:
    return AxisFault(
        f"no drive that {verb} set-point {channel.target} within {timeout:g} s "
        f"(statusword 0x{channel.statusword:04X})",
        axis=channel.axis.name, obj=od.TARGET_POSITION,
    )  # fmt: skip
