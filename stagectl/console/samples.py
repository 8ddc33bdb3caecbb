"""The latest samples of the stage, kept for the scope and for export as CSV and HDF5.

A page is sent every sample, so what it draws by minimum and maximum loses no spike. A frame is
little-endian: the numbers of version, axes and samples (uint32), a spare one, the number of the
first sample (float64), then float64[K] for each of `columns`. Exports are in SI units, at full
resolution.
"""

from __future__ import annotations

import csv
import io
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stagectl.protocol.wire import SampleBlock
from stagedata import F64

KEPT = 120_000
"""Samples kept: two minutes at 1 kHz."""
PER_AXIS = ("demand", "position", "error", "force", "offset", "status")
UNITS = {
    "time": "s", "late": "1", "demand": "m", "position": "m", "error": "m", "force": "N",
    "offset": "N", "status": "1",
}  # fmt: skip
MOST_IN_FRAME = 20_000
_HEADER = struct.Struct("<IIIId")


def columns(axes: list[str]) -> list[str]:
    """Names of the columns: time, late, and those of each axis."""
    return ["time", "late", *(f"{axis}.{name}" for axis in axes for name in PER_AXIS)]


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive samples: number of the first one, float64[columns, n]; nan where missed."""

    first: int
    values: F64


class SampleRing:
    """The latest samples.

    Args:
        share: control period over SYNC period: where between two setpoints the demand is that a
            sample is compared with (docs/reference/reference-stage.md).

    Attributes:
        end: number of the next sample.
    """

    def __init__(self, share: float = 0.0) -> None:
        self._share = share
        self._values = np.empty((0, KEPT))
        self._kept = 0
        self._demand: F64 | None = None
        self.end = 0

    def append(self, block: SampleBlock) -> None:
        """Take a block; a gap before it is filled with nan, one of another server begins anew."""
        count, axes = block.position.shape
        rows = 2 + len(PER_AXIS) * axes
        gap = block.first - self.end
        if rows != len(self._values) or not 0 <= gap < KEPT or count > KEPT:
            self._values = np.full((rows, KEPT), np.nan)
            self._kept, self._demand, gap, self.end = 0, None, 0, block.first
        if gap:
            self._put(np.full((rows, gap), np.nan))
            self._demand = None
        if count:
            self._put(self._of(block))

    def _of(self, block: SampleBlock) -> F64:
        count, axes = block.position.shape
        before = np.full((1, axes), np.nan) if self._demand is None else self._demand
        previous = np.concatenate([before, block.demand[:-1]])
        error = previous + (block.demand - previous) * self._share - block.position
        self._demand = block.demand[-1:].copy()
        made = np.empty((2 + len(PER_AXIS) * axes, count))
        made[0], made[1] = block.time, block.late
        missed = block.valid == 0
        for k, name in enumerate(PER_AXIS):
            values = error if name == "error" else getattr(block, _FIELDS.get(name, name))
            values = np.array(values, np.float64)
            if name not in ("demand", "offset"):
                values[missed] = np.nan
            made[2 + k :: len(PER_AXIS)] = values.T
        return made

    def _put(self, values: F64) -> None:
        count = values.shape[1]
        at = (self.end + np.arange(count)) % KEPT
        self._values[:, at] = values
        self.end += count
        self._kept = min(KEPT, self._kept + count)

    def since(self, number: int, most: int = KEPT) -> Stretch:
        """The samples from a number on, or from the oldest that is kept; at most so many."""
        first = min(max(number, self.end - self._kept), self.end)
        at = np.arange(first, min(self.end, first + most)) % KEPT
        return Stretch(first, self._values[:, at])


def frame(stretch: Stretch) -> bytes:
    """A stretch for the page."""
    rows, count = stretch.values.shape
    axes = max(rows - 2, 0) // len(PER_AXIS)
    return (
        _HEADER.pack(1, axes, count, 0, stretch.first)
        + np.ascontiguousarray(stretch.values, "<f8").tobytes()
    )


_FIELDS = {"status": "statusword"}


def as_csv(stretch: Stretch, names: Sequence[str]) -> bytes:
    """A table with a column per signal; what was missed is empty.

    Args:
        stretch: of samples.
        names: of its columns.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["sample", *(f"{name} [{_unit(name)}]" for name in names)])
    for number, row in enumerate(stretch.values.T.tolist(), stretch.first):
        writer.writerow([number, *("" if value != value else repr(value) for value in row)])
    return text.getvalue().encode()


def as_hdf5(stretch: Stretch, names: Sequence[str], about: str) -> bytes:
    """An HDF5 file with a data set per signal and attribute `unit`; nan where missed.

    Args:
        stretch: of samples.
        names: of its columns.
        about: machine and bus, as attribute `stage`.
    """
    import h5py

    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs["format"], file.attrs["version"] = "stagectl-scope", 1
        file.attrs["stage"] = about
        file["sample"] = stretch.first + np.arange(stretch.values.shape[1])
        for name, values in zip(names, stretch.values, strict=True):
            data = file.create_dataset(name.replace(".", "/"), data=values, compression="gzip")
            data.attrs["unit"] = _unit(name)
    return memory.getvalue()


def _unit(name: str) -> str:
    return UNITS[name.rpartition(".")[2]]
