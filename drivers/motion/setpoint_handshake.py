"""The setpoint handshake of profile position (pp): how a drive is handed one target.

First the target, with bits 5 and 6, which some drives want before bit 4; then the rising edge of
bit 4. The drive sets bit 12, bit 4 is cleared, the drive clears bit 12 when it can take another.

The functions are generators that take one step before each SYNC, on what the last one has brought:
`run` sends the SYNCs for one axis; in a stream several axes take their steps beside each other.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

from drivers import objects as od
from drivers.cyclic import Channel, Cycle
from drivers.drive import Command, Control, State, Status
from drivers.errors import AxisFault
from drivers.motion.fault_report import axis_fault
from drivers.motion.limits import Setpoint

HANDSHAKE_TIMEOUT = 0.5
NEAR = 5e-6
"""A drive that does not acknowledge counts as moving after this distance [m]."""
NOT_ACKNOWLEDGED = "statusword bit 12 in pp is not offered: setpoints are not acknowledged"
SETTLING_TIMEOUT = 2.0
"""Beyond the profile's own duration [s]."""

T = TypeVar("T")
Steps = Generator[None, None, T]


def hand_over(
    channel: Channel,
    setpoint: Setpoint,
    bits: int,
    ready_timeout: float,
    period: float,
    replace: bool = False,
) -> Steps[bool]:
    """Hands one setpoint to the drive.

    Args:
        channel: the axis, enabled in pp.
        setpoint: the target.
        bits: bits 5, 8 and 9 of the controlword.
        ready_timeout: until the drive can take it [s].
        period: Ts [s].
        replace: the drive's queue is full, and the setpoint replaces the one that waits.

    Returns:
        Whether the drive acknowledged.

    Raises:
        AxisFault: the drive neither acknowledged nor moved, or the axis faults.
    """
    word = int(Command.ENABLE_OPERATION) | bits
    if setpoint.relative:
        word |= int(Control.RELATIVE)
    channel.target, channel.offset, channel.controlword = setpoint.target, 0, word
    if replace:
        yield
    else:
        yield from _acknowledge(channel, False, ready_timeout, period, "is not ready for")
    channel.controlword = word | int(Control.NEW_SETPOINT)
    before = channel.position
    acknowledged = True
    try:
        yield from _acknowledge(channel, True, HANDSHAKE_TIMEOUT, period, "did not acknowledge")
    except AxisFault as unanswered:
        # some drives move without acknowledging; one that does neither has not taken the target
        near = round(NEAR / channel.axis.increment)
        moved = (
            abs(channel.position - before) > near or abs(channel.position - setpoint.end) <= near
        )
        if not moved or channel.state is not State.OPERATION_ENABLED:
            raise unanswered
        acknowledged = False
        channel.axis.add_limitation(NOT_ACKNOWLEDGED)
    channel.controlword = word
    if not acknowledged or bits & Control.CHANGE_IMMEDIATELY:
        yield from _acknowledge(channel, False, HANDSHAKE_TIMEOUT, period, "did not release")
    else:
        yield  # bit 12 stays set while the queue is full
    return acknowledged


def await_target(
    channel: Channel, setpoint: Setpoint, timeout: float, period: float
) -> Steps[None]:
    """Waits for bit 10 (target reached) where the axis is at its target, at most `timeout` [s].

    The bit alone may be of the previous target, or of one that the drive has in its place.

    Raises:
        AxisFault: the target is not reached in time, or the axis faults.
    """
    for _ in range(max(1, round(timeout / period))):
        yield
        if is_shown(channel, Status.TARGET_REACHED) and is_at(channel, setpoint):
            return
    raise _timed_out(channel, "did not reach", timeout)


def approach(channel: Channel, setpoint: Setpoint, period: float) -> Steps[None]:
    """Takes an axis to a target at once, whatever target it has; raises as the two above."""
    bits = int(Control.CHANGE_IMMEDIATELY)
    yield from hand_over(channel, setpoint, bits, HANDSHAKE_TIMEOUT, period)
    yield from await_target(channel, setpoint, setpoint.duration + SETTLING_TIMEOUT, period)


def run(cycle: Cycle, steps: Steps[T]) -> T:
    """Runs the steps of one axis, a cycle after each; returns what they return."""
    cycle.sync.resume()
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: T = end.value
            return result
        cycle.exchange()


def is_at(channel: Channel, setpoint: Setpoint) -> bool:
    """Whether the axis is where a setpoint leads, as near as its position window has it."""
    axis = channel.axis
    near = max(NEAR, axis.settings.position_window) / axis.increment
    return abs(channel.position - setpoint.end) <= near


def check_enabled(channel: Channel) -> None:
    """Raises an `AxisFault` where the last sample shows an axis out of OPERATION ENABLED."""
    if channel.valid and channel.state is not State.OPERATION_ENABLED:
        raise axis_fault(channel, "stopped during a profile move")


def is_shown(channel: Channel, bit: Status) -> bool:
    """Whether the last SYNC brought a statusword, with this bit set.

    Raises:
        AxisFault: it shows an axis out of OPERATION ENABLED.
    """
    check_enabled(channel)
    return channel.valid and bool(channel.statusword & bit)


def _acknowledge(
    channel: Channel, level: bool, timeout: float, period: float, failure: str
) -> Steps[None]:
    """Waits for a level of bit 12, at most `timeout` [s]."""
    for _ in range(max(1, round(timeout / period))):
        yield
        shown = is_shown(channel, Status.SETPOINT_ACKNOWLEDGED)
        if channel.valid and shown is level:
            return
    raise _timed_out(channel, failure, timeout)


def _timed_out(channel: Channel, failure: str, timeout: float) -> AxisFault:
    """The error of a drive that did not do something with its setpoint within `timeout` [s]."""
    return AxisFault(
        f"the drive {failure} setpoint {channel.target} within {timeout:g} s "
        f"(statusword 0x{channel.statusword:04X})",
        axis=channel.axis.name, obj=od.TARGET_POSITION,
    )  # fmt: skip
