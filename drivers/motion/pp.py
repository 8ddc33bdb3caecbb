"""Profile position (pp): moves by the drives' own profile generators, and back to csp."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from drivers.cyclic import Channel, Cycle
from drivers.drive import Control, Mode
from drivers.motion.limits import Setpoint, check_profile, checked_profile
from drivers.motion.power import Power
from drivers.motion.profile_moves import ProfileMoves
from drivers.motion.safe_stop import SafeStop
from drivers.motion.setpoint_handshake import (
    HANDSHAKE_TIMEOUT,
    SETTLING_TIMEOUT,
    await_target,
    hand_over,
)


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
        """Moves one axis to one target, or from target to target."""
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
            self._move(channel, setpoints)
        self._return_to_csp()

    def check(self, axis: str, velocity: float, acceleration: float) -> None:
        """Checks that the drive can make such moves; nothing is changed."""
        chosen = self._cycle.channel(axis).axis
        check_profile(chosen.settings, velocity, acceleration)
        chosen.check_mode(Mode.PROFILE_POSITION)

    def _move(self, channel: Channel, setpoints: Sequence[Setpoint]) -> None:
        """Moves an enabled axis along the setpoints.

        The first takes effect at once (bit 5), the others queue: each is handed over as soon as the
        drive can take it, and begins when the previous one is reached.
        """
        ready_timeout, bits = HANDSHAKE_TIMEOUT, int(Control.CHANGE_IMMEDIATELY)
        for number, setpoint in enumerate(setpoints):
            acknowledged = hand_over(self._cycle, channel, setpoint, bits, ready_timeout)
            ready_timeout += setpoint.duration + SETTLING_TIMEOUT
            if not acknowledged or number == len(setpoints) - 1:
                await_target(self._cycle, channel, setpoint, ready_timeout)
            bits = 0
        if setpoints[-1].relative:  # csp would take the distance for a position
            channel.target = channel.position

    @contextmanager
    def moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """All axes in pp, to be moved and redirected inside the block."""
        self._power.require_enabled()
        for axis in self._cycle.axes:
            axis.check_mode(Mode.PROFILE_POSITION)
        with self._stopping.on_failure():
            self._power.enter(Mode.PROFILE_POSITION)
            moves = ProfileMoves(self._cycle, self._power, velocity, acceleration)
            yield moves
            moves.end()
        self._return_to_csp()
