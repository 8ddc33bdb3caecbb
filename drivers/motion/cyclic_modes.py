"""Cyclic synchronous position (csp), velocity (csv) and torque (cst): one row of targets per SYNC.

Streams in csv and cst end at 0, since nothing follows the last row. A stream ended early brakes at
the acceleration limit (csv), or its force is 0 at once (cst). Forces imply neither travel nor
velocity limits, so in cst positions are watched: an axis that is too fast, or could no longer stop
within its travel, ends the stream.

Source: CiA 402-2, modes 8, 9 and 10: 0x607A, 0x60FF and 0x6071, with the force offset 0x60B2.
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
from drivers.cyclic import Channel, Cycle, RealTime, Sink, Until, decode_rows
from drivers.drive import Mode, unit
from drivers.errors import AxisFault
from drivers.motion.limits import checked_forces, checked_positions, checked_velocities
from drivers.motion.power import Power
from drivers.motion.safe_stop import SafeStop
from stagedata import F64, Samples

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


class CyclicModes:
    """Enables axes in csp and streams; arguments, results and errors as in `Stage`."""

    def __init__(self, cycle: Cycle, power: Power, stopping: SafeStop, real_time: RealTime) -> None:
        self._cycle, self._power = cycle, power
        self._stopping, self._real_time = stopping, real_time

    def enter_csp(self) -> None:
        """Enables all axes in csp where they stand; does nothing where they are.

        Where an axis does not offer csp, all are enabled in pp, which holds them as well.
        """
        mode = Mode.CYCLIC_SYNC_POSITION
        if not all(axis.streams for axis in self._cycle.axes):
            mode = Mode.PROFILE_POSITION
        with self._stopping.on_failure():
            if self._power.enabled and self._power.mode is mode:
                self._cycle.pump(0.0)
                self._cycle.sync.resume()
                self._cycle.exchange()  # the last TPDO may be old
                if self._power.enabled:
                    return
            self._power.enter(mode)

    def stream_position(
        self, position: F64, offset: F64, until: Until | None, sink: Sink | None
    ) -> Samples:
        """Streams one row of target positions and force offsets per SYNC.

        Args:
            position: float64[K, n] [m].
            offset: float64[K, n] [N].
            until: as for `Stage.stream`.
            sink: gets the samples as they come.

        Raises:
            AxisFault: the stage is not enabled, or not in csp; and as `Stage.stream`.
            LimitError: a row is beyond the limits; nothing was sent.
        """
        channels = self._cycle.channels
        self._power.require_enabled()
        if self._power.mode is Mode.PROFILE_POSITION and _is_still(position, channels):
            offset = np.zeros_like(offset)  # pp moves at a new setpoint only
        elif self._power.mode is not Mode.CYCLIC_SYNC_POSITION:
            for channel in channels:
                channel.axis.require_csp()
            raise AxisFault("the stage is not in csp: enable it first", axis=channels[0].axis.name)
        targets, offsets = checked_positions(
            position, offset, [c.axis.settings for c in channels], [c.target for c in channels],
            self._cycle.period,
        )  # fmt: skip
        planned = None
        if self._cycle.corrected is not None:
            units = np.array([c.axis.force_unit for c in channels])
            planned = np.clip(offset / units, -32768.0, 32767.0)
        rows = array("q")
        with self._stopping.on_failure(), self._real_time.in_motion():
            self._cycle.stream(targets, offsets, rows, sink, until, planned)
        return decode_rows(rows, self._cycle.axes)

    def stream_velocity(self, velocity: F64, offset: F64 | None, until: Until | None) -> Samples:
        """Streams one row of velocities per SYNC, from rest to rest.

        Args:
            velocity: float64[K, n] [m/s].
            offset: float64[K, n] force offsets [N]; None for none.
            until: as for `Stage.stream`.
        """
        velocity = np.asarray(velocity, dtype=np.float64)
        channels = self._cycle.channels
        targets, offsets = checked_velocities(
            velocity, np.zeros_like(velocity) if offset is None else offset,
            [c.axis.settings for c in channels],
            [c.position * c.axis.increment for c in channels],
            self._cycle.period,
        )  # fmt: skip
        slopes = [
            c.axis.settings.acceleration / unit(c.axis.settings, od.TARGET_VELOCITY)
            for c in channels
        ]
        return self._run(Mode.CYCLIC_SYNC_VELOCITY, targets, offsets, until, np.array(slopes))

    def stream_force(self, force: F64, until: Until | None) -> Samples:
        """Streams one row of forces [N] per SYNC, under a `TravelGuard`."""
        channels = self._cycle.channels
        targets = checked_forces(force, [c.axis.settings for c in channels])
        guard = TravelGuard(channels, self._cycle.clock, until)
        return self._run(Mode.CYCLIC_SYNC_TORQUE, targets, np.zeros_like(targets), guard, None)

    def _run(
        self, mode: Mode, targets: I64, offsets: I64, until: Until | None, slopes: F64 | None
    ) -> Samples:
        """Streams targets and, where `until` ended the stream early, takes them to 0.

        Args:
            mode: mode of operation, entered where the axes are in another one.
            targets: int64[K, n], within the limits [units of the bus].
            offsets: int64[K, n] force offsets, within the limits [1/1000 rated].
            until: gets the actual positions [m] after each SYNC; True ends the stream.
            slopes: largest change of each target on the way to 0 [units/s]; None: at once.
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
                ratios = (0.0,) if slopes is None else np.abs(left) / (slopes * self._cycle.period)
                steps = max(1, math.ceil(max(ratios)))
                shape = 1 - np.arange(1, steps + 1)[:, None] / steps
                braking = np.rint(left * shape).astype(np.int64)
                self._cycle.stream(braking, np.zeros_like(braking), rows, None, None)
        units = [unit(c.axis.settings, c.axis.target) for c in channels]
        return decode_rows(rows, self._cycle.axes, units)


def _is_still(position: F64, channels: Sequence[Channel]) -> bool:
    """Whether rows of target positions [m] only repeat the present ones."""
    present = [c.target * c.axis.increment for c in channels]
    return bool((np.asarray(position) == present).all())
