"""Motions of a stage, mode by mode: streams in csp, csv and cst, moves in pp, homing, halt.

Set-points are checked against the limits before anything is sent; what goes wrong on the way stops
all axes. Who may call, and when, is `stage.py`'s.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers import direct, homing, profile_position
from drivers.channel import Channel
from drivers.cia402 import Mode, State
from drivers.cycle import Sink, Until
from drivers.errors import AxisFault, ConfigurationError
from drivers.limits import (
    checked_counts,
    checked_forces,
    checked_profile,
    checked_velocities,
)
from drivers.power import HOLDING_TIMEOUT, RINGING_TIMEOUT, state_of
from drivers.profile_moves import ProfileMoves
from drivers.safe_stop import SafeStop
from drivers.samples import decode_rows
from drivers.stage_parts import StageParts
from stagedata import Samples

F64 = NDArray[np.float64]


class Motion:
    """What moves the axes of one stage; arguments, results and errors are those of `Stage`."""

    def __init__(self, parts: StageParts, stopping: SafeStop) -> None:
        self._network, self._axes, self._period = parts.network, parts.axes, parts.period
        self._cycle, self._power, self._real_time = parts.cycle, parts.power, parts.real_time
        self._stopping = stopping

    def home(self, force: bool) -> None:
        """All axes that are not homed yet, or all."""
        chosen = [c for c in self._cycle.channels if force or not c.axis.homed]
        if not chosen:
            return
        with self._stopping.on_failure():
            self._enter(Mode.HOMING, chosen)
            homing.home(self._cycle, chosen, self._period)
            # the drive is done when its demand is; what the loop still owes would become a
            # step of the target when csp takes over from the actual position
            self._power.wait_for_rest(HOLDING_TIMEOUT)
            self._cycle.check_alarms()

    def enable(self) -> None:
        """The loops of all axes are closed in csp where they stand."""
        with self._stopping.on_failure():
            if self._power.enabled and self._power.mode is Mode.CYCLIC_SYNC_POSITION:
                self._network.pump(0.0)
                self._cycle.resume()
                self._cycle.exchange()  # what was last heard may be long ago
                if self._power.enabled:
                    return
            self._enter(Mode.CYCLIC_SYNC_POSITION, self._cycle.channels)

    def _enter(self, mode: Mode, channels: Sequence[Channel]) -> None:
        """Axes enabled in the new mode.

        Enabled ones change over under power, or presliding would throw them back by some 10 um;
        where a drive refuses that, all go by SWITCH ON DISABLED.
        """
        self._network.pump(0.0)
        self._cycle.clear_alarms()
        if self._power.change_over(mode, channels):
            return
        self._power.switch_off()
        self._power.wait_for_rest(RINGING_TIMEOUT)
        self._power.set_mode(mode)
        self._power.go(State.OPERATION_ENABLED, channels)

    def halt(self) -> None:
        """Controlword bit 8."""
        self._check_enabled()
        with self._stopping.on_failure():
            self._power.halt(10 * self._stopping.braking_time + HOLDING_TIMEOUT)

    def stream(self, position: F64, offset: F64, until: Until | None, sink: Sink | None) -> Samples:
        """Set-points in csp."""
        channels = self._cycle.channels
        self._check_enabled()
        if self._power.mode is not Mode.CYCLIC_SYNC_POSITION:
            raise AxisFault("the stage is not in csp: enable it first", axis=self._axes[0].name)
        targets, offsets = checked_counts(
            position, offset, [a.settings for a in self._axes], [c.target for c in channels],
            self._period,
        )  # fmt: skip
        rows = array("q")
        with self._stopping.on_failure(), self._real_time.in_motion():
            self._cycle.stream(targets, offsets, rows, sink, until)
        return decode_rows(rows, [c.axis.scale for c in channels])

    def stream_velocity(self, velocity: F64, offset: F64 | None, until: Until | None) -> Samples:
        """Velocities in csv."""
        velocity = np.asarray(velocity, dtype=np.float64)
        positions = [c.position * c.axis.scale.increment for c in self._cycle.channels]
        targets, offsets = checked_velocities(
            velocity, np.zeros_like(velocity) if offset is None else offset,
            [a.settings for a in self._axes], positions, self._period,
        )  # fmt: skip
        return self._stream_directly(Mode.CYCLIC_SYNC_VELOCITY, targets, offsets, until)

    def stream_force(self, force: F64, until: Until | None) -> Samples:
        """Forces in cst."""
        targets = checked_forces(force, [a.settings for a in self._axes])
        guard = direct.Guard(self._cycle.channels, self._network.clock, until)
        return self._stream_directly(
            Mode.CYCLIC_SYNC_TORQUE, targets, np.zeros_like(targets), guard
        )

    def _stream_directly(
        self,
        mode: Mode,
        targets: NDArray[np.int64],
        offsets: NDArray[np.int64],
        until: Until | None,
    ) -> Samples:
        self._check_enabled()
        for axis in self._axes:
            axis.check_mode(mode)
        with self._stopping.on_failure(), self._real_time.in_motion():
            if self._power.mode is not mode:
                self._enter(mode, self._cycle.channels)
            return direct.stream(self._cycle, targets, offsets, until, self._period)

    def move_to(
        self,
        axis: str,
        position: float | Sequence[float],
        velocity: float,
        acceleration: float,
        relative: bool,
    ) -> None:
        """By the drive's own profile, and back to csp."""
        channel = self._channel(axis)
        wanted = [position] if isinstance(position, int | float) else list(position)
        start = channel.position * channel.axis.scale.increment
        setpoints = checked_profile(
            channel.axis.settings, start, wanted, velocity, acceleration, relative
        )
        with self._stopping.on_failure():
            slower = channel.axis.set_profile(velocity, acceleration)
            setpoints = [replace(s, duration=slower * s.duration) for s in setpoints]
            self._enter(Mode.PROFILE_POSITION, self._cycle.channels)
            profile_position.move(self._cycle, channel, setpoints, self._period)
        self.enable()

    @contextmanager
    def profile_moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """All axes in pp meanwhile, and back to csp."""
        self._check_enabled()
        for axis in self._axes:
            axis.check_mode(Mode.PROFILE_POSITION)
        with self._stopping.on_failure():
            self._enter(Mode.PROFILE_POSITION, self._cycle.channels)
            moves = ProfileMoves(self._cycle, self._power, velocity, acceleration, self._period)
            yield moves
            moves.end()
        self.enable()

    def _channel(self, axis: str) -> Channel:
        for channel in self._cycle.channels:
            if channel.axis.name == axis:
                return channel
        names = ", ".join(a.name for a in self._axes)
        raise ConfigurationError(f"no such axis (there are {names})", axis=axis)

    def _check_enabled(self) -> None:
        if self._power.enabled:
            return
        name = self._axes[0].name
        for channel in self._cycle.channels:
            if not channel.seen or state_of(channel) is not State.OPERATION_ENABLED:
                name = channel.axis.name
                break
        raise AxisFault("the stage is not enabled", axis=name)
