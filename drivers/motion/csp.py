"""Cyclic synchronous position (csp): target position and force offset with every SYNC."""

from __future__ import annotations

from array import array

import numpy as np
from numpy.typing import NDArray

from drivers.cyclic import Cycle, RealTime, Sink, Until, decode_rows
from drivers.drive import Mode
from drivers.errors import AxisFault
from drivers.motion.limits import checked_positions
from drivers.motion.power import Power
from drivers.motion.safe_stop import SafeStop
from stagedata import Samples

F64 = NDArray[np.float64]


class CyclicPosition:
    """Enables axes in csp and streams; arguments, results and errors as in `Stage`."""

    mode = Mode.CYCLIC_SYNC_POSITION

    def __init__(self, cycle: Cycle, power: Power, stopping: SafeStop, real_time: RealTime) -> None:
        self._cycle, self._power = cycle, power
        self._stopping, self._real_time = stopping, real_time

    def enter(self) -> None:
        """Enables all axes in csp where they stand; does nothing where they are."""
        with self._stopping.on_failure():
            if self._power.enabled and self._power.mode is self.mode:
                self._cycle.pump(0.0)
                self._cycle.resume()
                self._cycle.exchange()  # the last TPDO may be old
                if self._power.enabled:
                    return
            self._power.enter(self.mode)

    def stream(self, position: F64, offset: F64, until: Until | None, sink: Sink | None) -> Samples:
        """Streams one row of target positions [m] and force offsets [N] per SYNC."""
        channels = self._cycle.channels
        self._power.require_enabled()
        if self._power.mode is not self.mode:
            raise AxisFault("the stage is not in csp: enable it first", axis=channels[0].axis.name)
        targets, offsets = checked_positions(
            position, offset, [c.axis.settings for c in channels], [c.target for c in channels],
            self._cycle.period,
        )  # fmt: skip
        planned = None
        if self._cycle.corrected is not None:
            units = np.array([c.axis.scale.force for c in channels])
            planned = np.clip(offset / units, -32768.0, 32767.0)
        rows = array("q")
        with self._stopping.on_failure(), self._real_time.in_motion():
            self._cycle.stream(targets, offsets, rows, sink, until, planned)
        return decode_rows(rows, [c.axis.scale for c in channels])
