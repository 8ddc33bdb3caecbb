"""Profile position (pp): moves by the drives' own profile generators."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from drivers.cyclic import Cycle
from drivers.drive import Mode
from drivers.motion import profile_position
from drivers.motion.limits import checked_profile
from drivers.motion.power import Power
from drivers.motion.profile_moves import ProfileMoves
from drivers.motion.safe_stop import SafeStop


class ProfilePosition:
    """Moves in pp and back to csp; arguments and errors are those of `Stage`.

    Args:
        cycle, power, stopping: of the stage.
        back: closes the loops of all axes in csp.
    """

    mode = Mode.PROFILE_POSITION

    def __init__(
        self, cycle: Cycle, power: Power, stopping: SafeStop, back: Callable[[], None]
    ) -> None:
        self._cycle, self._power = cycle, power
        self._stopping, self._back = stopping, back

    def move_to(
        self,
        axis: str,
        position: float | Sequence[float],
        velocity: float,
        acceleration: float,
        relative: bool,
    ) -> None:
        """One axis, to one target or from target to target."""
        channel = self._cycle.channel(axis)
        targets = [position] if isinstance(position, int | float) else list(position)
        start = channel.position * channel.axis.scale.increment
        setpoints = checked_profile(
            channel.axis.settings, start, targets, velocity, acceleration, relative
        )
        with self._stopping.on_failure():
            slower = channel.axis.set_profile(velocity, acceleration)
            setpoints = [replace(s, duration=slower * s.duration) for s in setpoints]
            self._power.enter(self.mode)
            profile_position.move(self._cycle, channel, setpoints, self._cycle.period)
        self._back()

    @contextmanager
    def moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """All axes in pp, to be moved and redirected inside the block."""
        self._power.require_enabled()
        for axis in self._cycle.axes:
            axis.check_mode(self.mode)
        with self._stopping.on_failure():
            self._power.enter(self.mode)
            period = self._cycle.period
            moves = ProfileMoves(self._cycle, self._power, velocity, acceleration, period)
            yield moves
            moves.end()
        self._back()
