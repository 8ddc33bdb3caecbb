"""The state and the samples as they are published; STO and brake as the drives report them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from drivers import objects as od
from drivers.cyclic.samples import FIELDS, HEAD
from drivers.drive import Axis, decode
from drivers.errors import DriverError
from drivers.objects import ObjectRef
from drivers.stage import Stage
from stagectl.protocol.state import AxisState
from stagectl.protocol.wire import SampleBlock

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


_TARGET, _OFFSET, _POSITION, _FORCE, _STATUS, _VALID = range(6)
_TIME, _LATE = 0, 1
_LOAD = 0.5
"""The bus load is averaged over this, at least [s]."""


class BusLoad:
    """Share of a bus' time that its frames take.

    Args:
        bitrate: [bit/s].
    """

    def __init__(self, bitrate: float) -> None:
        self._bitrate = bitrate
        self._since, self._bits = time.monotonic(), 0
        self._load: float | None = None

    def of(self, bits: int) -> float | None:
        """The load, once it is known, after this many bits of all frames."""
        now = time.monotonic()
        if now - self._since >= _LOAD:
            self._load = (bits - self._bits) / ((now - self._since) * self._bitrate)
            self._since, self._bits = now, bits
        return self._load


class Sampling:
    """Samples of the drivers as arrays in SI units, and the axes as last sampled.

    Args:
        ratio: of the drives' control period to that of SYNC. A drive goes to its new demand within
            the SYNC period; when it is sampled, it has taken the first of these steps.
    """

    def __init__(self, ratio: float) -> None:
        self._ratio = ratio
        self.count = 0
        self._demand: tuple[float, ...] | None = None

    def block(self, stage: Stage, samples: Sequence[Sequence[int]]) -> SampleBlock:
        """Samples, at least one, as they are published."""
        raw = np.array(samples, dtype=np.int64)
        axes = raw[:, HEAD:].reshape(len(raw), -1, FIELDS)
        increments = np.array([axis.increment for axis in stage.axes])
        forces = np.array([axis.force_unit for axis in stage.axes])
        first, self.count = self.count, self.count + len(raw)
        block = SampleBlock(
            first=first,
            time=raw[:, _TIME] * np.float64(1e-9),
            late=raw[:, _LATE].astype(np.uint8),
            demand=axes[:, :, _TARGET] * increments,
            position=axes[:, :, _POSITION] * increments,
            force=axes[:, :, _FORCE] * forces,
            offset=axes[:, :, _OFFSET] * forces,
            statusword=axes[:, :, _STATUS].astype(np.uint16),
            valid=axes[:, :, _VALID].astype(np.uint8),
        )
        previous = block.demand[-2] if len(raw) > 1 else self._demand
        if previous is not None:
            aligned = previous + (block.demand[-1] - previous) * self._ratio
            self._error = aligned - block.position[-1]
        self._demand = tuple(block.demand[-1].tolist())
        return block

    _error = None

    def axes(self, stage: Stage, signals: DriveSignals) -> tuple[AxisState, ...]:
        """The axes as last sampled."""
        states = []
        enabled = stage.enabled
        columns = zip(
            stage.axes, stage.statuswords, stage.positions, stage.targets, stage.forces,
            stage.offsets, strict=True,
        )  # fmt: skip
        for number, (axis, status, position, target, force, offset) in enumerate(columns):
            seen = status is not None
            error = None if self._error is None else float(self._error[number])
            states.append(
                AxisState(
                    name=axis.name,
                    position=position if seen else None,
                    demand=target if seen else None,
                    error=(error if enabled else 0.0) if seen else None,
                    force=force if seen else None,
                    offset=offset if seen else None,
                    status=str(decode(status)) if status is not None else "not heard",
                    statusword=status,
                    homed=axis.homed,
                    sto=signals.safe_torque_off(axis.name),
                    brake=signals.brake(axis.name),
                )
            )
        return tuple(states)
