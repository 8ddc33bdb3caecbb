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
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.cyclic import Channel, CorrectedOffsets, OffsetCorrection, Until, decode_rows
from drivers.drive import Mode, unit
from drivers.errors import AxisFault
from drivers.motion import TravelGuard, checked_forces, checked_positions, checked_velocities
from drivers.stage.power import StagePower
from drivers.stage.session import exclusive
from stagedata import F64, Samples

I64 = NDArray[np.int64]


class StageStreams(StagePower):
    """Streams setpoints to all axes."""

    def correct_offsets(self, correction: OffsetCorrection | None) -> None:
        """Has the force offsets of all further csp streams corrected from SYNC to SYNC.

        Args:
            correction: chooses each row's offsets after the sample before it; None: no longer. If
                it fails, its last correction stays in effect, and `notices` says so.
        """
        corrected = None if correction is None else CorrectedOffsets(correction, self._cycle.sync)
        self._cycle.corrected = corrected

    @exclusive
    def stream(
        self,
        position: F64,
        offset: F64,
        until: Until | None = None,
    ) -> Samples:
        """Streams setpoints in csp, one row per SYNC, and returns the samples.

        Consecutive streams continue the same SYNC grid. Sample k is taken at SYNC k, at which the
        drives also take row k over.

        Args:
            position: float64[K, n] target positions [m].
            offset: float64[K, n] force offsets [N].
            until: gets the actual positions [m] after each SYNC; True ends the stream.

        Raises:
            LimitError: a setpoint is outside the limits; nothing was sent.
            AxisFault: an axis faulted or fell silent; all axes are stopped.
            BusError: the bus failed; the drives stop when they miss the host's heartbeat.
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
            self._cycle.stream(targets, offsets, rows, self.sink, until, planned)
        return decode_rows(rows, self.axes)

    @exclusive
    def stream_velocity(
        self,
        velocity: F64,
        offset: F64 | None = None,
        until: Until | None = None,
    ) -> Samples:
        """Streams velocities in csv, from rest to rest; the axes stay enabled in csv.

        `enable` returns them to csp. The sink gets none of these samples.

        Args:
            velocity: float64[K, n] [m/s]; the last row is 0.
            offset: float64[K, n] force offsets [N], 0 by default.
            until: as for `stream`; the axes then brake at their acceleration limit.

        Raises:
            LimitError: outside velocity, acceleration or travel; nothing was sent.
            ConfigurationError: a drive does not offer csv.
            AxisFault, BusError: as `stream`.
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

    @exclusive
    def stream_force(self, force: F64, until: Until | None = None) -> Samples:
        """Streams forces in cst; the axes stay enabled in cst, without force.

        `enable` waits for rest and returns them to csp. The sink gets none of these samples.

        Args:
            force: float64[K, n] [N]; the last row is 0.
            until: as for `stream`; the force is then 0 at once.

        Raises:
            LimitError: above the peak force; nothing was sent.
            ConfigurationError: a drive does not offer cst.
            AxisFault: as `stream`; or an axis exceeded its velocity limit, or could no longer stop
                within its travel.
            BusError: as `stream`.
        """
        channels = self._cycle.channels
        targets = checked_forces(force, [c.axis.settings for c in channels])
        guard = TravelGuard(channels, self.clock, until)
        return self._run(Mode.CYCLIC_SYNC_TORQUE, targets, np.zeros_like(targets), guard, None)

    def hold(self, duration: float) -> Samples:
        """Streams the present targets and offsets for `duration` [s]; raises as `stream`."""
        rows = max(1, round(duration / self.settings.sync_period))
        return self.stream(np.tile(self.targets, (rows, 1)), np.tile(self.offsets, (rows, 1)))

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
        for axis in self.axes:
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
        return decode_rows(rows, self.axes, units)


def _is_still(position: F64, channels: Sequence[Channel]) -> bool:
    """Whether rows of target positions [m] only repeat the present ones."""
    present = [c.target * c.axis.increment for c in channels]
    return bool((np.asarray(position) == present).all())
