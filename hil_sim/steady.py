"""Several SYNCs of all drives in one call, while nothing but demand and measurements changes.

This is possible in csp with the mapping of our own driver, one RPDO and one TPDO per drive: each
sends its statusword, position and force, and takes over target and force offset. Each layer of a
drive states its own conditions for nothing else to happen (`PdoEngine.sole`,
`MotionControl.steady`). Where anything else may happen, the drives handle the SYNCs one by one.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hil_sim.cia301.rpdo import Rpdo
from hil_sim.cia402 import objects as o
from hil_sim.cia402.steady import Steady
from hil_sim.drive import Drive
from hil_sim.ports import F64, BlockPlantPort, Handlers, SetpointBlock

_RECEIVED = (o.CONTROLWORD, o.TARGET_POSITION, o.TORQUE_OFFSET)
_SENT = (o.STATUSWORD, o.POSITION_ACTUAL, o.TORQUE_ACTUAL)
_SETPOINT = np.dtype([("word", "<u2"), ("target", "<i4"), ("offset", "<i2")])
_SAMPLE = np.dtype([("status", "<u2"), ("position", "<i4"), ("force", "<i2")])
_SIZE = _SETPOINT.itemsize  # of either
_CAUTION = 1.0 - 1e-9
"""Share of a bound that is used, as bounds are converted to other units and rounded."""


class _Part(NamedTuple):
    """One drive's share of a block of SYNCs.

    Attributes:
        drive: the drive.
        rpdo: the one that it receives.
        statusword: that it sends for as long as the SYNCs are steady.
        within: bounds within which they are.
        setpoints: of all SYNCs, records of `_SETPOINT`, shape (K,).
        within_count: how many of these, from the first on, are within the bounds.
    """

    drive: Drive
    rpdo: Rpdo
    statusword: int
    within: Steady
    setpoints: Any
    within_count: int


class SteadyDrives:
    """The drives of a stage on a bus in virtual time.

    Args:
        drives: all of them, in the order in which they answer.
        plant: theirs.
    """

    def __init__(self, drives: Sequence[Drive], plant: BlockPlantPort) -> None:
        self._drives, self._plant = drives, plant
        self._split = struct.Struct(f"{_SIZE}s").iter_unpack

    def run(
        self,
        rows: Sequence[Sequence[bytes]],
        ids: Sequence[int],
        grid_ns: tuple[int, int],
        sync_id: int,
        expected: Sequence[tuple[int, int, bytes]],
        handlers: Handlers,
        answers: list[bytes],
    ) -> None:
        """Answer SYNCs as long as each is steady; see `SteadyNodes.run`."""
        drives = self._drives
        if not len(ids) == len(expected) == len(drives):
            return
        if handlers.get(sync_id) != tuple([drive.on_sync for drive in drives]):
            return
        columns = list(zip(*rows, strict=True))
        parts: list[_Part] = []
        for drive, can_id, answer, column in zip(drives, ids, expected, columns, strict=True):
            part = _part(drive, can_id, answer, handlers, column)
            if part is None:
                return
            parts.append(part)
        count = min(part.within_count for part in parts)
        if not count or len({part.within.ticks for part in parts}) > 1:
            return
        block = _block(parts, count, grid_ns)
        try:
            self._plant.run_block(block)
        finally:  # also where a signal was waiting for the end of this call
            if len(block.reports):
                answers += [data for (data,) in self._split(_conclude(parts, block.reports))]


def _part(
    drive: Drive,
    can_id: int,
    answer: tuple[int, int, bytes],
    handlers: Handlers,
    frames: Sequence[bytes],
) -> _Part | None:
    """The part of a drive that receives these frames under this id; None if it is not steady."""
    sole, within = drive.pdo.sole, drive.motion.steady()
    if sole is None or within is None:
        return None
    rpdo, tpdo = sole
    status = drive.dictionary.integer(o.STATUSWORD)
    if (
        rpdo.keys != _RECEIVED
        or tpdo.keys != _SENT
        or rpdo.acting != (o.CONTROLWORD,)
        or rpdo.pending is not None
        or drive.dictionary.integer(o.SYNC_OVERFLOW)
        or rpdo.cob_id != can_id
        or answer != (tpdo.cob_id, _SIZE, status.to_bytes(2, "little"))
        or handlers.get(can_id) != (rpdo.on_frame,)
        or tpdo.cob_id in handlers
        or set(map(len, frames)) != {_SIZE}
    ):
        return None
    setpoints = np.frombuffer(b"".join(frames), dtype=_SETPOINT)
    target, offset = setpoints["target"], setpoints["offset"]
    steady = setpoints["word"] == within.controlword
    steady &= (target >= within.lowest) & (target <= within.highest)
    steady &= (offset >= -within.force) & (offset <= within.force)
    count = len(frames) if steady.all() else int(steady.argmin())
    return _Part(drive, rpdo, status, within, setpoints, count)


def _block(parts: Sequence[_Part], count: int, grid_ns: tuple[int, int]) -> SetpointBlock:
    """The first `count` setpoints of all drives, for the plant."""
    positions, forces = np.empty((2, count, len(parts)))
    bounds = np.empty((len(parts), 3))
    for a, part in enumerate(parts):
        motor, within, setpoints = part.drive.motor, part.within, part.setpoints[:count]
        positions[:, a], forces[:, a] = motor.commands(
            setpoints["target"].astype(np.int64), setpoints["offset"].astype(np.int64)
        )
        worst = within.following_error * motor.unit * _CAUTION
        bounds[a] = within.lowest_counts, within.highest_counts, worst
    return SetpointBlock(*grid_ns, positions, forces, parts[0].within.ticks, bounds)


def _conclude(parts: Sequence[_Part], reports: F64) -> bytes:
    """Bring the drives to the end of the SYNCs reported; returns the frames that they have sent."""
    done = len(reports)
    samples = np.empty((done, len(parts)), dtype=_SAMPLE)
    for a, part in enumerate(parts):
        motor, setpoints = part.drive.motor, part.setpoints[:done]
        samples["status"][:, a] = part.statusword
        samples["position"][:, a] = motor.positions(reports[:, a, 0])
        samples["force"][:, a] = motor.permilles(reports[:, a, 1])
        part.rpdo.store(setpoints[-1].tobytes())
        part.drive.motion.note_steady(setpoints["target"].tolist())
    return samples.tobytes()
