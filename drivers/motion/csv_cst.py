"""Cyclic synchronous velocity (csv) and torque (cst): streams of velocities or forces.

Both end at 0, since nothing follows the last row. A stream ended early brakes at the acceleration
limit (csv), or its force is 0 at once (cst). Forces imply neither travel nor velocity limits, so in
cst positions are watched: an axis that is too fast, or could no longer stop within its travel, ends
the stream.
"""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.canopen import Clock
from drivers.cyclic import Channel, Cycle, RealTime, Until, decode_rows
from drivers.drive import Mode, unit
from drivers.errors import AxisFault
from drivers.motion.limits import checked_forces, checked_velocities
from drivers.motion.power import Power
from drivers.motion.safe_stop import SafeStop
from stagedata import Samples

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_SPEED_OVER = 5
"""SYNCs over which an axis' velocity is measured."""
_REACTION = 0.01
"""Time until the drive brakes [s]."""


class TravelGuard:
    """Watches velocity and travel during a stream of forces, as its `until`.

    Args:
        channels: of all axes.  clock: of the stream.  until: the application's.
    """

    def __init__(self, channels: Sequence[Channel], clock: Clock, until: Until | None) -> None:
        self._channels, self._clock, self._until = channels, clock, until
        self._past: deque[tuple[int, tuple[float, ...]]] = deque(maxlen=_SPEED_OVER + 1)

    def __call__(self, positions: tuple[float, ...]) -> bool:
        """Whether to end the stream.

        Raises:
            AxisFault: an axis is too fast, or could no longer stop within its travel.
        """
        now = self._clock.now_ns()
        self._past.append((now, positions))
        then, before = self._past[0]
        if len(self._past) > _SPEED_OVER and now > then:
            for channel, at, was in zip(self._channels, positions, before, strict=True):
                self._check(channel, at, (at - was) / (now - then) * 1e9)
        return self._until is not None and self._until(positions)

    @staticmethod
    def _check(channel: Channel, at: float, speed: float) -> None:
        s = channel.axis.settings
        if abs(speed) > s.velocity:
            raise AxisFault(
                f"{abs(speed):.4g} m/s exceeds the velocity limit {s.velocity:g} m/s",
                axis=s.name, obj=od.TARGET_FORCE,
            )  # fmt: skip
        low, high = s.travel
        rest = at + speed * _REACTION + math.copysign(speed * speed / (2 * s.acceleration), speed)
        if not low <= rest <= high:
            below = rest < low
            raise AxisFault(
                f"at {at:.6g} m and {speed:.4g} m/s it may not stop before the limit "
                f"{low if below else high:g} m",
                axis=s.name, obj=od.SOFT_LIMIT_LOW if below else od.SOFT_LIMIT_HIGH,
            )  # fmt: skip


class CyclicVelocity:
    """Streams velocities in csv, from rest to rest; arguments and errors as in `Stage`."""

    mode = Mode.CYCLIC_SYNC_VELOCITY

    def __init__(self, cycle: Cycle, power: Power, stopping: SafeStop, real_time: RealTime) -> None:
        self._cycle, self._streams = cycle, _Streams(cycle, power, stopping, real_time)

    def stream(self, velocity: F64, offset: F64 | None, until: Until | None) -> Samples:
        """Streams one row of velocities [m/s] per SYNC."""
        velocity = np.asarray(velocity, dtype=np.float64)
        channels = self._cycle.channels
        targets, offsets = checked_velocities(
            velocity, np.zeros_like(velocity) if offset is None else offset,
            [c.axis.settings for c in channels],
            [c.position * c.axis.scale.increment for c in channels],
            self._cycle.period,
        )  # fmt: skip
        units = [unit(c.axis.settings, od.TARGET_VELOCITY) for c in channels]
        slopes = [
            c.axis.settings.acceleration / speed * self._cycle.period
            for c, speed in zip(channels, units, strict=True)
        ]
        return self._streams.run(self.mode, targets, offsets, until, units, slopes)


class CyclicForce:
    """Streams forces in cst under a `TravelGuard`; arguments and errors as in `Stage`."""

    mode = Mode.CYCLIC_SYNC_TORQUE

    def __init__(self, cycle: Cycle, power: Power, stopping: SafeStop, real_time: RealTime) -> None:
        self._cycle, self._streams = cycle, _Streams(cycle, power, stopping, real_time)

    def stream(self, force: F64, until: Until | None) -> Samples:
        """Streams one row of forces [N] per SYNC."""
        channels = self._cycle.channels
        targets = checked_forces(force, [c.axis.settings for c in channels])
        guard = TravelGuard(channels, self._cycle.clock, until)
        units = [unit(c.axis.settings, od.TARGET_FORCE) for c in channels]
        return self._streams.run(self.mode, targets, np.zeros_like(targets), guard, units, None)


class _Streams:
    """Common to csv and cst: enters the mode where needed, and ends at 0."""

    def __init__(self, cycle: Cycle, power: Power, stopping: SafeStop, real_time: RealTime) -> None:
        self._cycle, self._power = cycle, power
        self._stopping, self._real_time = stopping, real_time

    def run(
        self,
        mode: Mode,
        targets: I64,
        offsets: I64,
        until: Until | None,
        units: Sequence[float],
        slopes: Sequence[float] | None,
    ) -> Samples:
        """Streams targets and, where `until` ended the stream early, takes them to 0.

        Args:
            mode: mode of operation, entered where the axes are in another one.
            targets: int64[K, n], within the limits [units of the bus].
            offsets: int64[K, n] force offsets, within the limits [1/1000 rated].
            until: gets the actual positions [m] after each SYNC; True ends the stream.
            units: SI value of one unit of each axis' target.
            slopes: largest change of each target per SYNC on the way to 0; None: at once.
        """
        self._power.require_enabled()
        for axis in self._cycle.axes:
            axis.check_mode(mode)
        channels, rows = self._cycle.channels, array("q")
        with self._stopping.on_failure(), self._real_time.in_motion():
            if self._power.mode is not mode:
                self._power.enter(mode)
            self._cycle.stream(targets, offsets, rows, None, until)
            left = np.array([c.target for c in channels])
            if left.any():
                ratios = (0.0,) if slopes is None else np.abs(left) / np.array(slopes)
                steps = max(1, math.ceil(max(ratios)))
                shape = 1 - np.arange(1, steps + 1)[:, None] / steps
                braking = np.rint(left * shape).astype(np.int64)
                self._cycle.stream(braking, np.zeros_like(braking), rows, None, None)
        return decode_rows(rows, [c.axis.scale for c in channels], units)
