"""Profile position (pp): moves by the drives' own profile generators, and back to csp.

Source: CiA 402-2, mode 1: 0x607A, 0x6081, 0x6083, 0x6084, and 0x6040 bits 4, 5, 6 and 8.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from drivers.cyclic import Channel, Until, decode_rows
from drivers.cyclic.rows import Row
from drivers.drive import Control, Mode
from drivers.errors import AxisFault
from drivers.motion import ProfileMoves, Setpoint, check_profile, checked_profile
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
from drivers.stage.power import StagePower
from drivers.stage.session import exclusive
from stagedata import Samples


class StageProfiles(StagePower):
    """Moves axes by their drives' own profiles (pp)."""

    @exclusive
    def check_move_to(self, axis: str, velocity: float, acceleration: float) -> None:
        """Checks, before power, that `move_to` can move an axis of the booted stage.

        The profile is written to the drive, which shows whether it takes it.

        Args:
            axis: its name.
            velocity: of the profile [m/s].
            acceleration: of the profile, also for braking [m/s^2].

        Raises:
            LimitError: velocity or acceleration is outside the axis' limits, or nothing in the
                drive's units.
            ConfigurationError: its drive lacks mode pp or an object of its profile, or holds a
                faster one.
            NodeError: no answer, or the drive refuses the profile.
        """
        chosen = self._cycle.channel(axis).axis
        check_profile(chosen.settings, velocity, acceleration)
        chosen.check_mode(Mode.PROFILE_POSITION)
        chosen.set_profile(velocity, acceleration)

    @exclusive
    def move_to(
        self,
        axis: str,
        position: float | Sequence[float],
        velocity: float,
        acceleration: float,
        relative: bool = False,
    ) -> None:
        """Moves one axis by the drive's own profile (pp); returns when the target is reached.

        All axes end enabled in csp, this one holding the target.

        Args:
            axis: its name.
            position: absolute [m], or several positions, each begun when the previous one is
                reached.
            velocity: of the profile [m/s].
            acceleration: of the profile, also for braking [m/s^2].
            relative: positions count from the previous target, the first from the actual position.

        Raises:
            LimitError: outside the axis' limits; nothing was sent.
            ConfigurationError: the drive does not offer pp, or lacks an object of its profile;
                nothing was changed.
            AxisFault: the axis faulted or did not arrive; all axes are stopped.
        """
        channel = self._cycle.channel(axis)
        targets = [position] if isinstance(position, int | float) else list(position)
        start = channel.position * channel.axis.increment
        setpoints = checked_profile(
            channel.axis.settings, start, targets, velocity, acceleration, relative
        )
        self.check_move_to(axis, velocity, acceleration)
        with self._stopping.on_failure():
            slower = channel.axis.set_profile(velocity, acceleration)
            setpoints = [replace(s, duration=slower * s.duration) for s in setpoints]
            self._power.enter(Mode.PROFILE_POSITION)
            run(self._cycle, _follow(channel, setpoints, self._cycle.period))
        self.enable()

    @exclusive
    def stream_to(
        self,
        targets: Sequence[float],
        velocity: Sequence[float],
        acceleration: Sequence[float],
        until: Until | None = None,
    ) -> Samples:
        """Moves all axes at once by their drives' own profiles (pp), with a sample of every SYNC.

        For a stage that holds in pp, having a drive without csp. The samples' demand is the target,
        from the first one on.

        Args:
            targets: [m], one per axis.
            velocity: of each axis' profile [m/s].
            acceleration: of each axis' profile, also for braking [m/s^2].
            until: gets the actual positions [m] after each SYNC; True halts the axes where they
                come to rest.

        Raises:
            LimitError: outside an axis' limits; nothing was sent.
            AxisFault: the stage is not enabled in pp, an axis faulted or did not arrive; all axes
                are stopped.
        """
        self._power.require_enabled()
        if self._power.mode is not Mode.PROFILE_POSITION:
            raise AxisFault("the stage is not in pp", axis=self.axes[0].name)
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
            self._cycle.stream_rows(_rows(channels, under_way), rows, self.sink, until)
            if under_way:
                self.halt()
        return decode_rows(rows, self.axes)

    @contextmanager
    def profile_moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """Moves by the drives' own profiles whose targets may change on the way.

        The end of the block waits for all targets; the axes then are enabled in csp. An exception
        inside stops all axes. Other threads cannot use the bus meanwhile.

        Args:
            velocity: default of the profiles [m/s].
            acceleration: default of the profiles, also for braking [m/s^2].

        Raises:
            AxisFault: the stage is not enabled, an axis faults or does not arrive.
            ConfigurationError: a drive does not offer pp.
        """
        with self._network.lock:
            self._power.require_enabled()
            for axis in self.axes:
                axis.check_mode(Mode.PROFILE_POSITION)
            with self._stopping.on_failure():
                self._power.enter(Mode.PROFILE_POSITION)
                moves = ProfileMoves(self._cycle, velocity, acceleration)
                yield moves
                moves.end()
            self.enable()

    @exclusive
    def halt(self) -> None:
        """As `StagePower.halt`; in pp, where the axes come to rest is their target then.

        A drive whose halt ends goes on to the target that it has: it gets another one before.

        Raises:
            AxisFault: as there.
        """
        if self._power.mode is not Mode.PROFILE_POSITION:
            super().halt()
            return
        self._power.require_enabled()
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
