"""Profile position (pp): moves by the drives' own profile generators, and back to csp.

Source: CiA 402-2, mode 1: 0x607A, 0x6081, 0x6083, 0x6084, and 0x6040 bits 4, 5, 6 and 8.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from drivers.cyclic import Channel, Cycle, Sink, Until, decode_rows
from drivers.cyclic.rows import Row
from drivers.drive import Control, Mode
from drivers.errors import AxisFault
from drivers.motion.limits import Setpoint, check_profile, checked_profile
from drivers.motion.power import Power
from drivers.motion.profile_moves import ProfileMoves
from drivers.motion.safe_stop import SafeStop
from drivers.motion.setpoint_handshake import (
    HANDSHAKE_TIMEOUT,
    SETTLING_TIMEOUT,
    Steps,
    approach,
    await_target,
    hand_over,
    run,
)
from drivers.motion.standstill import brake
from stagedata import Samples


class ProfilePosition:
    """Moves in pp; arguments and errors as in `Stage`.

    Args:
        cycle, power, stopping: of the stage.
        return_to_csp: enables all axes in csp.
    """

    def __init__(
        self, cycle: Cycle, power: Power, stopping: SafeStop, return_to_csp: Callable[[], None]
    ) -> None:
        self._cycle, self._power = cycle, power
        self._stopping, self._return_to_csp = stopping, return_to_csp

    def move_to(
        self,
        axis: str,
        position: float | Sequence[float],
        velocity: float,
        acceleration: float,
        relative: bool,
    ) -> None:
        """Moves one axis to one target [m], or from target to target, at [m/s, m/s^2]."""
        channel = self._cycle.channel(axis)
        targets = [position] if isinstance(position, int | float) else list(position)
        start = channel.position * channel.axis.increment
        setpoints = checked_profile(
            channel.axis.settings, start, targets, velocity, acceleration, relative
        )
        self.check(axis, velocity, acceleration)
        with self._stopping.on_failure():
            slower = channel.axis.set_profile(velocity, acceleration)
            setpoints = [replace(s, duration=slower * s.duration) for s in setpoints]
            self._power.enter(Mode.PROFILE_POSITION)
            run(self._cycle, _follow(channel, setpoints, self._cycle.period))
        self._return_to_csp()

    def stream_to(
        self,
        targets: Sequence[float],
        velocity: Sequence[float],
        acceleration: Sequence[float],
        until: Until | None,
        sink: Sink | None,
    ) -> Samples:
        """Moves all axes to their targets [m] at once, with a sample of every SYNC.

        Raises:
            AxisFault: the stage is not enabled, or not in pp; and as `Stage.stream_to`.
            LimitError: a target is beyond the limits; nothing was sent.
        """
        self._power.require_enabled()
        if self._power.mode is not Mode.PROFILE_POSITION:
            raise AxisFault("the stage is not in pp", axis=self._cycle.axes[0].name)
        channels, period, rows = self._cycle.channels, self._cycle.period, array("q")
        checked = [
            checked_profile(c.axis.settings, c.target * c.axis.increment, [t], v, a, False)[0]
            for c, t, v, a in zip(channels, targets, velocity, acceleration, strict=True)
        ]
        with self._stopping.on_failure():
            under_way = []
            for c, s, v, a in zip(channels, checked, velocity, acceleration, strict=True):
                if s.target != c.target:
                    slower = c.axis.set_profile(v, a)
                    timed = replace(s, duration=slower * s.duration)
                    under_way.append(approach(c, timed, period))
            self._cycle.stream_rows(_rows(channels, under_way), rows, sink, until)
            if under_way:
                self.halt()
        return decode_rows(rows, self._cycle.axes)

    def halt(self) -> None:
        """Halts all axes, which are enabled in pp; where they come to rest is their target then.

        A drive whose halt ends goes on to the target that it has: it gets another one before.
        """
        bits = int(Control.CHANGE_IMMEDIATELY | Control.HALT)
        with self._stopping.on_failure():
            brake(self._cycle, self._stopping.halt_timeout)
            for channel in self._cycle.channels:
                here = Setpoint(channel.position, channel.position, 0.0)
                taken = hand_over(channel, here, bits, HANDSHAKE_TIMEOUT, self._cycle.period)
                run(self._cycle, taken)
            for channel in self._cycle.channels:
                channel.controlword &= ~int(Control.HALT)
            self._cycle.exchange()

    def check(self, axis: str, velocity: float, acceleration: float) -> None:
        """Checks that the drive can move at [m/s, m/s^2]: its profile is written, nothing moves."""
        chosen = self._cycle.channel(axis).axis
        check_profile(chosen.settings, velocity, acceleration)
        chosen.check_mode(Mode.PROFILE_POSITION)
        chosen.set_profile(velocity, acceleration)

    @contextmanager
    def moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """All axes in pp, to be moved and redirected inside the block, at [m/s, m/s^2]."""
        self._power.require_enabled()
        for axis in self._cycle.axes:
            axis.check_mode(Mode.PROFILE_POSITION)
        with self._stopping.on_failure():
            self._power.enter(Mode.PROFILE_POSITION)
            moves = ProfileMoves(self._cycle, self._power, velocity, acceleration)
            yield moves
            moves.end()
        self._return_to_csp()


def _follow(channel: Channel, setpoints: Sequence[Setpoint], period: float) -> Steps[None]:
    """Moves an enabled axis along the setpoints.

    The first takes effect at once (bit 5), the others queue: each is handed over as soon as the
    drive can take it, and begins when the previous one is reached.
    """
    ready_timeout, bits = HANDSHAKE_TIMEOUT, int(Control.CHANGE_IMMEDIATELY)
    for number, setpoint in enumerate(setpoints):
        acknowledged = yield from hand_over(channel, setpoint, bits, ready_timeout, period)
        ready_timeout += setpoint.duration + SETTLING_TIMEOUT
        if not acknowledged or number == len(setpoints) - 1:
            yield from await_target(channel, setpoint, ready_timeout, period)
        bits = 0
    if setpoints[-1].relative:  # csp would take the distance for a position
        channel.target = channel.position


def _rows(channels: Sequence[Channel], under_way: list[Steps[None]]) -> Iterator[Row]:
    """The rows of a stream until all targets are reached, at least one.

    Axes that have reached theirs are taken out of `under_way`.
    """
    while True:
        under_way[:] = [steps for steps in under_way if _goes_on(steps)]
        yield (
            [(channel, channel.pack()) for channel in channels],
            [(channel, channel.target, 0) for channel in channels],
        )
        if not under_way:
            return


def _goes_on(steps: Steps[None]) -> bool:
    """Takes the next of the steps; False where there is none."""
    for _ in steps:
        return True
    return False
