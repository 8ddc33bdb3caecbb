"""Moves by the drives' own profiles whose targets may change on the way: `Stage.profile_moves`.

Covers the whole setpoint handshake: a target at once, even during a move (bit 5); after the present
one (without it); passing the present one without a stop (bit 9); relative to the previous target
(bit 6); halt and resume (bit 8). Drives differ in the details; commands follow CiA 402, and each
axis is checked to end at its target.
"""

from __future__ import annotations

import math

from drivers import objects as od
from drivers.cyclic import Channel, Cycle
from drivers.drive import Control, Status
from drivers.errors import AxisFault, ConfigurationError
from drivers.motion.limits import Setpoint, checked_profile
from drivers.motion.power import HOLDING_TIMEOUT
from drivers.motion.setpoint_handshake import (
    HANDSHAKE_TIMEOUT,
    SETTLING_TIMEOUT,
    check_enabled,
    hand_over,
    is_at,
    is_shown,
    run,
)
from drivers.motion.standstill import brake

_FROM_TARGET = 0x3
"""Bits of 0x60F2 that are 0 where relative targets count from the previous target."""


class _Course:
    """The setpoints an axis has been given.

    Attributes:
        channel: of the axis.
        setpoint: the last one; None: there was none yet.
        seconds: how long all setpoints may take [s].
        velocity, acceleration: of the last setpoint [m/s, m/s^2].
        slower: factor on their duration where the drive is slower.
        queued: setpoints may be waiting in the drive.
    """

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self.setpoint: Setpoint | None = None
        self.seconds = 0.0
        self.velocity, self.acceleration = 0.0, math.inf
        self.slower = 1.0
        self.queued = False

    @property
    def start(self) -> float:
        """Where the next setpoint begins: the last target, at first the actual position [m]."""
        counts = self.channel.position if self.setpoint is None else self.setpoint.end
        return counts * self.channel.axis.increment

    @property
    def is_done(self) -> bool:
        """Whether the drive reports the target reached, and the axis is at it."""
        if self.setpoint is None:
            return True
        shown = is_shown(self.channel, Status.TARGET_REACHED)
        return shown and is_at(self.channel, self.setpoint)

    def take(self, setpoint: Setpoint, velocity: float, acceleration: float, queued: bool) -> None:
        """Notes a setpoint that the drive has taken [m/s, m/s^2], and how long it may take."""
        way = abs(setpoint.end - self.channel.position) * self.channel.axis.increment
        turning = 2 * self.velocity / acceleration + self.velocity**2 / (acceleration * velocity)
        moving = way / velocity + setpoint.duration + turning
        seconds = self.slower * moving + SETTLING_TIMEOUT
        self.seconds = self.seconds + seconds if queued else seconds
        self.setpoint, self.queued = setpoint, queued
        self.velocity, self.acceleration = velocity, acceleration


class ProfileMoves:
    """All axes in pp. Between calls the drives keep moving, but receive no heartbeat.

    Args:
        cycle: the cyclic path; all axes are enabled in pp.
        velocity: default of the profiles [m/s].
        acceleration: default of the profiles, also for braking [m/s^2].

    Attributes:
        halted: between `halt` and `resume`.
    """

    def __init__(self, cycle: Cycle, velocity: float, acceleration: float) -> None:
        self.halted = False
        self._cycle = cycle
        self._velocity, self._acceleration = velocity, acceleration
        self._courses = {c: _Course(c) for c in cycle.channels}

    def to(
        self,
        axis: str,
        position: float,
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        relative: bool = False,
        queued: bool = False,
        passing: bool = False,
    ) -> None:
        """Hands over one target; returns when the drive has taken it.

        Without `queued` the target takes effect at once and replaces all earlier ones.

        Args:
            axis: its name.
            position: absolute [m].
            velocity: of this move [m/s], by default that of all.
            acceleration: of this move, also for braking [m/s^2], by default that of all.
            relative: `position` counts from the previous target, at first from the actual position.
            queued: begins when the present target is reached. Drives queue one target: with two
                ahead this returns when the first of them is reached.
            passing: as `queued`, but the present target is passed at velocity where the drive
                supports bit 9.

        Raises:
            LimitError: outside the axis' limits; nothing was sent. All axes are stopped unless it
                is caught inside the block.
            ConfigurationError: no such axis, or relative targets count from elsewhere (0x60F2).
            AxisFault: the drive does not take the target, or an axis faults.
        """
        channel = self._cycle.channel(axis)
        course = self._courses[channel]
        speed = self._velocity if velocity is None else velocity
        rate = self._acceleration if acceleration is None else acceleration
        queued = (queued or passing) and course.setpoint is not None
        full = course.queued and bool(channel.statusword & Status.SETPOINT_ACKNOWLEDGED)
        if relative and full and not queued:
            # drives differ in which of two targets they count from
            position, relative = course.start + position, False
        (setpoint,) = checked_profile(
            channel.axis.settings, course.start, [position], speed, rate, relative
        )
        if relative:
            _check_base(channel)
        if (speed, rate) != (course.velocity, course.acceleration):
            course.slower = channel.axis.set_profile(speed, rate)
        bits = 0 if queued else int(Control.CHANGE_IMMEDIATELY)
        if passing and queued:
            bits |= int(Control.CHANGE_ON_SETPOINT)
        if self.halted:
            bits |= int(Control.HALT)
        ready_timeout, replaces = HANDSHAKE_TIMEOUT + course.seconds, full and not queued
        run(
            self._cycle,
            hand_over(channel, setpoint, bits, ready_timeout, self._cycle.period, replaces),
        )
        course.take(setpoint, speed, rate, queued)

    def run(self, duration: float) -> None:
        """Keeps the moves going for `duration` [s].

        Raises:
            AxisFault: an axis faults meanwhile.
        """
        for _ in self._cycle.cycles(duration):
            self._check_enabled()

    def wait(self) -> None:
        """Waits until every axis is at its last target.

        Raises:
            AxisFault: an axis does not arrive in time, faults, or is halted.
        """
        courses = [w for w in self._courses.values() if w.setpoint is not None]
        if self.halted and not all(w.is_done for w in courses):
            raise AxisFault("is halted: resume it first", axis=courses[0].channel.axis.name)
        timeout = max((w.seconds for w in courses), default=0.0)
        if not courses:
            return
        for _ in self._cycle.cycles(timeout):
            self._check_enabled()
            if all(w.is_done for w in courses):
                for course in courses:
                    course.seconds, course.queued = 0.0, False
                return
        late = next(w for w in courses if not w.is_done)
        increment = late.channel.axis.increment
        raise AxisFault(
            f"target {late.start:.9g} m is not reached within {timeout:.3g} s, it "
            f"is at {late.channel.position * increment:.9g} m "
            f"(statusword 0x{late.channel.statusword:04X})",
            axis=late.channel.axis.name, obj=od.TARGET_POSITION,
        )  # fmt: skip

    def halt(self) -> None:
        """Brakes all axes (0x605D); they hold and keep their targets.

        Raises:
            AxisFault: an axis faults or does not come to rest.
        """
        slowest = max(w.slower * w.velocity / w.acceleration for w in self._courses.values())
        brake(self._cycle, 10 * slowest + HOLDING_TIMEOUT)
        self.halted = True

    def resume(self) -> None:
        """Continues to the targets after a halt.

        Raises:
            AxisFault: an axis faults.
        """
        for channel in self._cycle.channels:
            channel.controlword &= ~int(Control.HALT)
        self.halted = False
        self.run(self._cycle.period)

    def end(self) -> None:
        """Waits for all axes, unless they are halted, and sets the targets where they stay.

        Raises:
            AxisFault: as `wait`.
        """
        if not self.halted:
            self.wait()
        for course in self._courses.values():
            # 0x607A may hold a distance, which csp would take for a position
            if course.setpoint is not None:
                end = course.setpoint.end
                course.channel.target = course.channel.position if self.halted else end

    def _check_enabled(self) -> None:
        for channel in self._cycle.channels:
            check_enabled(channel)


def _check_base(channel: Channel) -> None:
    """Checks that relative targets count from the previous target, as the limits assume."""
    held = channel.axis.node.read_if_offered(od.POSITIONING_OPTION)
    if held is not None and held & _FROM_TARGET:
        raise ConfigurationError(
            f"0x{held:04X}: relative targets do not count from the previous target",
            axis=channel.axis.name, obj=od.POSITIONING_OPTION,
        )  # fmt: skip
