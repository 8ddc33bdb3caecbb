"""Samples of a recording on disk, whole or in blocks: docs/formats/recording.md version 1.

Blocks bound the memory of what goes through a long recording once.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np

from stagectl.errors import UnusableInput
from stagectl.store import hdf5
from stagectl.store.recording import MAX_MOVES, NO_SITE, SIGNALS, check_format
from stagedata import MOVE_KINDS, AxisSignals, Move, Recording

BLOCK = 2**18
"""Samples, over four minutes at 1 kHz: a shorter recording is one block."""


def read_recording(path: Path | str) -> Recording:
    """Read a recording of format version 1.

    Args:
        path: the HDF5 file.

    Returns:
        The recording; arrays in SI units, `source` is the path as given.

    Raises:
        UnusableInput: no such file, not HDF5, truncated, another format or a newer version, a
            missing dataset, lengths that differ, a non-finite sample, a move outside the samples.
    """
    (whole,) = RecordingBlocks(path, hdf5.MAX_SAMPLES)
    return whole


class RecordingBlocks:
    """The blocks of a recording, read one after the other.

    Blocks are of about equal length, up to 1.5 times `size`, and begin with a move where one begins
    near. Each is a `Recording` of its samples and of the moves that begin in it; time goes on.

    Args:
        path: the HDF5 file.
        size: samples per block.

    Attributes:
        source: the path as given.
        machine: text of the machine file.
        samples: of all blocks together.

    Raises:
        UnusableInput: as `read_recording`; samples are read and checked with their block.
    """

    def __init__(self, path: Path | str, size: int = BLOCK) -> None:
        self.source = str(path)
        with hdf5.open_hdf5(path) as file:
            check_format(file)
            self.machine = hdf5.read_text(file, "machine")
            hdf5.read_floats(file, "time", part=slice(0, 0))
            self.samples = len(file["time"])
            hdf5.check_unit(file, "time", "s")
            self._recipe = hdf5.read_text(file, "recipe", default="")
            self._started = hdf5.read_line(file, "started", default="")
            group = hdf5.open_group(file, "axes")
            self._axes = tuple(hdf5.member_names(group))
            if not self._axes:
                raise UnusableInput("/axes: no axis")
            for name in self._axes:
                _axis(group, name, self.samples, slice(0, 0))
            self._moves = _moves(file, self._axes, self.samples)
        self._starts = [move.start for move in self._moves]
        self._cuts = _cuts(self.samples, size, self._starts)

    def __len__(self) -> int:
        return len(self._cuts) - 1

    def __iter__(self) -> Iterator[Recording]:
        with hdf5.open_hdf5(self.source) as file:
            for first, stop in pairwise(self._cuts):
                yield self._block(file, first, stop)

    def _block(self, file: h5py.File, first: int, stop: int) -> Recording:
        joint = max(first - 1, 0)  # the sample before tells whether time goes on
        time = hdf5.read_floats(file, "time", self.samples, slice(joint, stop))
        if np.any(np.diff(time) <= 0):
            sample = joint + int(np.argmax(np.diff(time) <= 0)) + 1
            raise UnusableInput(f"/time: sample {sample}: not later than the one before")
        group = hdf5.open_group(file, "axes")
        last = stop if stop < self.samples else self.samples + 1  # a move may begin at the very end
        begun = slice(bisect_left(self._starts, first), bisect_left(self._starts, last))
        return Recording(
            machine=self.machine,
            recipe=self._recipe,
            started=self._started,
            time=time[first - joint :],
            axes={
                name: _axis(group, name, self.samples, slice(first, stop)) for name in self._axes
            },
            moves=tuple(
                replace(move, start=move.start - first, end=min(move.end, stop) - first)
                for move in self._moves[begun]
            ),
            source=self.source,
        )


def _cuts(length: int, size: int, starts: list[int]) -> list[int]:
    """Where blocks begin and the last one ends: even, or with the last move shortly before that."""
    count = max(1, -(-length // size))
    cuts = [0]
    for number in range(1, count):
        even = number * length // count
        at = bisect_right(starts, even) - 1
        near = at >= 0 and starts[at] > even - length // count // 2
        cuts.append(starts[at] if near else even)
    return [*cuts, length]


def _axis(axes: h5py.Group, name: str, length: int, part: slice) -> AxisSignals:
    group = hdf5.open_group(axes, name)
    demand, offset, actual, force = (hdf5.read_floats(group, s, length, part) for s, _ in SIGNALS)
    for signal, unit in SIGNALS:
        hdf5.check_unit(group, signal, unit)
    statusword = None
    if "statusword" in group:
        statusword = hdf5.read_integers(group, "statusword", length, part).astype(np.uint16)
    valid = np.ones(len(demand), dtype=np.bool_)
    if "valid" in group:
        valid = hdf5.read_integers(group, "valid", length, part).astype(np.bool_)
    missing = tuple(s for s, _ in SIGNALS if not group[s].attrs.get("logged", 1))
    return AxisSignals(demand, offset, actual, force, statusword, valid, missing)


def _moves(file: h5py.File, axes: tuple[str, ...], length: int) -> tuple[Move, ...]:
    table = hdf5.read_array(file, "moves", "V", MAX_MOVES)
    columns = table.dtype.names or ()
    ends = [f"{side}_{axis}" for side in ("from", "to") for axis in axes]
    for name in ("kind", "start", "end", *ends):
        if name not in columns:
            raise UnusableInput(f"/moves: column {name} missing")
    moves: list[Move] = []
    for i, row in enumerate(table):
        place = f"/moves: row {i}"
        kind = row["kind"].decode("ascii", "replace") if isinstance(row["kind"], bytes) else ""
        if kind not in MOVE_KINDS:
            raise UnusableInput(f"{place}: kind {kind!r} is none of {', '.join(MOVE_KINDS)}")
        start, end = int(row["start"]), int(row["end"])
        earliest = moves[-1].start if moves else 0
        if not earliest <= start <= end <= length:
            raise UnusableInput(
                f"{place}: samples {start}..{end} are not in order within 0..{length}"
            )
        origin = {axis: float(row[f"from_{axis}"]) for axis in axes}
        target = {axis: float(row[f"to_{axis}"]) for axis in axes}
        if not np.all(np.isfinite([*origin.values(), *target.values()])):
            raise UnusableInput(f"{place}: a non-finite position")
        site = int(row["site"]) if "site" in columns else NO_SITE
        moves.append(Move(kind, start, end, origin, target, site if site > NO_SITE else None))
    return tuple(moves)
