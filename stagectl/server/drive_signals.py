"""STO and brake of the drives: read by SDO in a thread of its own, between SYNCs, once a second."""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor

from drivers import objects as od
from drivers.drive import Axis
from drivers.errors import DriverError
from drivers.objects import ObjectRef
from drivers.stage import Stage

_PERIOD = 1.0
"""Between two readings [s]."""
_Read = dict[str, tuple[int | None, int | None]]


class DriveSignals:
    """What the drives last said of their digital inputs (0x60FD) and outputs (0x60FE).

    Args:
        period: between two readings [s].
    """

    def __init__(self, period: float = _PERIOD) -> None:
        self._period = period
        self._pool = ThreadPoolExecutor(1, "signals")
        self._reading: Future[_Read] | None = None
        self._due = 0.0
        self._read: _Read = {}
        self._refused: set[tuple[str, ObjectRef]] = set()

    def turn(self, stage: Stage | None) -> None:
        """Take what has been read, and read again when it is time; never waits."""
        if self._reading is not None and self._reading.done():
            self._read, self._reading = self._reading.result(), None
        now = time.monotonic()
        if stage is None:
            self._read = {}
        elif self._reading is None and now >= self._due:
            self._due = now + self._period
            self._reading = self._pool.submit(self._ask, stage.axes)

    def safe_torque_off(self, axis: str) -> bool | None:
        """0x60FD bit 3: STO is active or the enable input is open; None: not reported."""
        inputs, _ = self._read.get(axis, (None, None))
        return None if inputs is None else bool(inputs & od.INTERLOCK)

    def brake(self, axis: str) -> bool | None:
        """0x60FE:01 bit 0: the brake is set; None: not reported."""
        _, outputs = self._read.get(axis, (None, None))
        return None if outputs is None else bool(outputs & 1)

    def close(self) -> None:
        """Read no more."""
        self._pool.shutdown(wait=False)

    def _ask(self, axes: tuple[Axis, ...]) -> _Read:
        return {
            axis.name: (self._one(axis, od.DIGITAL_INPUTS), self._one(axis, od.DIGITAL_OUTPUTS))
            for axis in axes
        }

    def _one(self, axis: Axis, obj: ObjectRef) -> int | None:
        if (axis.name, obj) in self._refused:
            return None
        try:
            value = axis.node.read_if_offered(obj)
        except DriverError:  # silent now: asked again
            return None
        if value is None:
            self._refused.add((axis.name, obj))
        return value
