"""Moves of all axes by their drives' own profiles (pp) with a sample of every SYNC.

The setpoint handshake of `setpoint_handshake`, a step per SYNC of a stream: first the target with
bit 5, then bit 4 until the drive acknowledges (bit 12), then target reached (bit 10).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum, auto

from drivers.cyclic import Channel
from drivers.cyclic.rows import Row
from drivers.drive import Command, Control, State, Status
from drivers.motion.limits import Setpoint
from drivers.motion.setpoint_handshake import (
    HANDSHAKE_TIMEOUT,
    NEAR,
    NOT_ACKNOWLEDGED,
    SETTLING_TIMEOUT,
    is_at,
    timed_out,
)

_WORD = int(Command.ENABLE_OPERATION | Control.CHANGE_IMMEDIATELY)


class _Phase(Enum):
    READY = auto()
    ASKED = auto()
    TAKEN = auto()
    MOVING = auto()
    DONE = auto()


class Approach:
    """One axis on its way to one target.

    Args:
        channel: of the axis, enabled in pp.
        setpoint: the target.
        period: Ts [s].
    """

    def __init__(self, channel: Channel, setpoint: Setpoint, period: float) -> None:
        self._channel, self._setpoint, self._period = channel, setpoint, period
        self._phase, self._since = _Phase.READY, 0
        self._near = round(NEAR / channel.axis.increment)
        self._before = channel.position
        channel.target, channel.offset, channel.controlword = setpoint.target, 0, _WORD

    @property
    def is_done(self) -> bool:
        """Whether the drive has reported the target reached."""
        return self._phase is _Phase.DONE

    def step(self) -> None:
        """Prepares the next SYNC by the last sample.

        Raises:
            AxisFault: the drive does not take the target, or does not reach it in time.
        """
        channel, waited = self._channel, self._since * self._period
        self._since += 1
        acknowledged = bool(channel.valid and channel.statusword & Status.SETPOINT_ACKNOWLEDGED)
        reached = bool(channel.valid and channel.statusword & Status.TARGET_REACHED)
        match self._phase:
            case _Phase.READY if self._since > 2 and not acknowledged:
                channel.controlword = _WORD | int(Control.NEW_SETPOINT)
                self._enter(_Phase.ASKED)
            case _Phase.READY if waited > HANDSHAKE_TIMEOUT:
                raise timed_out(channel, "is not ready for", HANDSHAKE_TIMEOUT)
            case _Phase.ASKED if acknowledged or self._has_moved(waited):
                channel.controlword = _WORD
                self._enter(_Phase.TAKEN)
            case _Phase.TAKEN if not acknowledged:
                self._enter(_Phase.MOVING)
            case _Phase.TAKEN if waited > HANDSHAKE_TIMEOUT:
                raise timed_out(channel, "did not release", HANDSHAKE_TIMEOUT)
            case _Phase.MOVING if reached and is_at(channel, self._setpoint):
                self._enter(_Phase.DONE)
            case _Phase.MOVING if waited > self._setpoint.duration + SETTLING_TIMEOUT:
                raise timed_out(
                    channel, "did not reach", self._setpoint.duration + SETTLING_TIMEOUT
                )

    def _enter(self, phase: _Phase) -> None:
        self._phase, self._since = phase, 0

    def _has_moved(self, waited: float) -> bool:
        """Whether a drive that has not acknowledged in time moves all the same.

        Raises:
            AxisFault: it does not.
        """
        channel = self._channel
        if waited <= HANDSHAKE_TIMEOUT:
            return False
        moved = is_at(channel, self._setpoint) or abs(channel.position - self._before) > self._near
        if not moved or channel.state is not State.OPERATION_ENABLED:
            raise timed_out(channel, "did not acknowledge", HANDSHAKE_TIMEOUT)
        channel.axis.add_limitation(NOT_ACKNOWLEDGED)
        return True


def profile_rows(channels: Sequence[Channel], approaches: Sequence[Approach]) -> Iterator[Row]:
    """The rows of a stream until all targets are reached; at least one."""
    while True:
        for approach in approaches:
            if not approach.is_done:
                approach.step()
        yield (
            [(channel, channel.pack()) for channel in channels],
            [(channel, channel.target, 0) for channel in channels],
        )
        if all(approach.is_done for approach in approaches):
            return
