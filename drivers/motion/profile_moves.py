"""Moves by the drives' own profiles (pp), told while others are under way: `Stage.profile_moves`.

Everything the set-point handshake offers: a target at once, also in the middle of a move (bit 5),
behind the one under way (without it), passing that one without a stop (bit 9), from the target
before (bit 6); halt and going on (bit 8). How drives do it differs; what is told here is CiA 402,
and that each axis ends where it was told to is checked.
"""

from __future__ import annotations

from drivers import objects as od
from drivers.cyclic import Channel, Cycle
from drivers.drive import Control, State, Status
from drivers.errors import AxisFault, ConfigurationError, NodeError
from drivers.motion.limits import checked_profile
from drivers.motion.power import HOLDING_TIMEOUT, Cycles, Power, fault, state_of
from drivers.motion.profile_position import HANDSHAKE_TIMEOUT, NEAR, SETTLING_TIMEOUT, hand_over

_FROM_TARGET = 0x3
"""Bits of 0x60F2 that are 0 where relative targets count from the target before."""


class _Way:
    """What an axis was told to do.

    Attributes:
        channel: of the axis.
        end: where the last set-point leads to [increments]; None: it was not told anything yet.
        seconds: how long everything told so far may take at most [s].
        velocity, acceleration: of its last set-point [m/s, m/s^2].
        slower: how many times longer than by these the drive may take.
        queued: set-points may be waiting in the drive.
    """

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self.end: int | None = None
        self.seconds = 0.0
        self.velocity = self.acceleration = 0.0
        self.slower = 1.0
        self.queued = False

    @property
    def there(self) -> bool:
        """The drive says that it has arrived, and it is where it was told to go."""
        if self.end is None:
            return True
        channel, settings = self.channel, self.channel.axis.settings
        near = max(NEAR, settings.position_window) / channel.axis.scale.increment
        reached = bool(channel.valid and channel.statusword & Status.TARGET_REACHED)
        return reached and abs(channel.position - self.end) <= near


class ProfileMoves:
    """All axes in pp. While nothing is called here the drives go on, but hear no heartbeat.

    Args:
        cycle: the cyclic path; all axes are enabled in pp.
        power: of the same axes.
        velocity: of the profiles, if nothing else is said [m/s].
        acceleration: both ways [m/s^2].
        period: Ts [s].

    Attributes:
        halted: between `halt` and `resume`.
    """

    def __init__(
        self, cycle: Cycle, power: Power, velocity: float, acceleration: float, period: float
    ) -> None:
        self.halted = False
        self._cycle = cycle
        self._power = power
        self._velocity, self._acceleration = velocity, acceleration
        self._period = period
        self._ways = {c.axis.name: _Way(c) for c in cycle.channels}

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
        """Hands over one target; returns when the drive has taken it, not when it is reached.

        Without `queued` it counts at once: what was under way or waiting is given up for it.

        Args:
            axis: its name.
            position: absolute [m].
            velocity: of this one [m/s]; that of all by default.
            acceleration: of this one, both ways [m/s^2]; that of all by default.
            relative: `position` counts from the target before, the first from where the axis is.
            queued: when the one under way is reached. Drives have room for one that waits: with two
                ahead this returns when the first of them is reached.
            passing: as `queued`, but the one under way is passed at its velocity where the drive
                can do that (bit 9).

        Raises:
            LimitError: outside the axis' limits; nothing was sent, but all axes are stopped unless
                it is caught inside.
            ConfigurationError: no such axis, or relative targets count from elsewhere (0x60F2).
            AxisFault: the drive does not take it, or an axis faults.
        """
        way = self._way(axis)
        channel = way.channel
        speed = self._velocity if velocity is None else velocity
        rate = self._acceleration if acceleration is None else acceleration
        increment = channel.axis.scale.increment
        start = (channel.position if way.end is None else way.end) * increment
        settings = channel.axis.settings
        queued = (queued or passing) and way.end is not None
        full = way.queued and bool(channel.statusword & Status.SETPOINT_ACKNOWLEDGED)
        if relative and full and not queued:  # which of two targets a drive counts from differs
            position, relative = start + position, False
        (setpoint,) = checked_profile(settings, start, [position], speed, rate, relative)
        if relative:
            _check_base(channel)
        if (speed, rate) != (way.velocity, way.acceleration):
            way.slower = channel.axis.set_profile(speed, rate)
        turning = 2 * way.velocity / rate + way.velocity**2 / (rate * speed)
        bits = 0 if queued else int(Control.CHANGE_IMMEDIATELY)
        if passing and queued:
            bits |= int(Control.CHANGE_ON_SETPOINT)
        if self.halted:
            bits |= int(Control.HALT)
        hand_over(
            self._cycle, channel, setpoint, bits, HANDSHAKE_TIMEOUT + way.seconds, self._period,
            instead=full and not queued,
        )  # fmt: skip
        own = abs(setpoint.end * increment - channel.position * increment) / speed
        own = way.slower * (own + setpoint.duration + turning) + SETTLING_TIMEOUT
        way.seconds = way.seconds + own if queued else own
        way.end, way.queued, way.velocity, way.acceleration = setpoint.end, queued, speed, rate

    def run(self, duration: float) -> None:
        """Lets the drives go on for `duration` [s].

        Raises:
            AxisFault: an axis faults meanwhile.
        """
        for _ in Cycles(self._cycle, duration, self._period, blind=False):
            self._check_enabled()

    def wait(self) -> None:
        """Until every axis is where its last target is.

        Raises:
            AxisFault: one does not get there, faults, or waits to be resumed.
        """
        ways = [w for w in self._ways.values() if w.end is not None]
        if self.halted and not all(w.there for w in ways):
            raise AxisFault("is halted: resume it first", axis=ways[0].channel.axis.name)
        timeout = max((w.seconds for w in ways), default=0.0)
        if not ways:
            return
        for _ in Cycles(self._cycle, timeout, self._period, blind=False):
            self._check_enabled()
            if all(w.there for w in ways):
                for way in ways:
                    way.seconds, way.queued = 0.0, False
                return
        late = next(w for w in ways if not w.there)
        increment = late.channel.axis.scale.increment
        raise AxisFault(
            f"target {(late.end or 0) * increment:.9g} m is not reached within {timeout:.3g} s, it "
            f"is at {late.channel.position * increment:.9g} m "
            f"(statusword 0x{late.channel.statusword:04X})",
            axis=late.channel.axis.name, obj=od.TARGET_POSITION,
        )  # fmt: skip

    def halt(self) -> None:
        """Brakes all axes (0x605D); they hold, and keep their targets.

        Raises:
            AxisFault: an axis faults or does not come to rest.
        """
        slowest = max(
            (
                w.slower * w.velocity / w.acceleration
                for w in self._ways.values()
                if w.end is not None
            ),
            default=0.0,
        )
        self._power.stand_still(10 * slowest + HOLDING_TIMEOUT)
        self.halted = True

    def resume(self) -> None:
        """On to the targets after a halt.

        Raises:
            AxisFault: an axis faults.
        """
        for channel in self._cycle.channels:
            channel.controlword &= ~int(Control.HALT)
        self.halted = False
        self.run(self._period)

    def end(self) -> None:
        """Waits for all axes, unless they are halted; then targets are where the axes are to stay.

        Raises:
            AxisFault: as `wait`.
        """
        if not self.halted:
            self.wait()
        for way in self._ways.values():
            if way.end is not None:  # 0x607A may hold a distance; csp will take it for a place
                way.channel.target = way.channel.position if self.halted else way.end

    def _way(self, axis: str) -> _Way:
        way = self._ways.get(axis)
        if way is None:
            raise ConfigurationError(f"no such axis (there are {', '.join(self._ways)})", axis=axis)
        return way

    def _check_enabled(self) -> None:
        for channel in self._cycle.channels:
            if channel.valid and state_of(channel) is not State.OPERATION_ENABLED:
                raise fault(channel, "stopped during a profile move")


def _check_base(channel: Channel) -> None:
    """Relative targets have to count from the target before, or limits would be checked in vain."""
    node = channel.axis.node
    if not node.offers(od.POSITIONING_OPTION):
        return
    try:
        held = node.read(od.POSITIONING_OPTION)
    except NodeError as refused:
        if refused.abort_code is None:
            raise
        return
    if held & _FROM_TARGET:
        raise ConfigurationError(
            f"0x{held:04X}: relative targets count from elsewhere than the target before",
            axis=channel.axis.name, obj=od.POSITIONING_OPTION,
        )  # fmt: skip
