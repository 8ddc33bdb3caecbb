"""The journal of a run in progress: append-only, so that a killed process loses nothing.

One unbuffered `write` per SYNC hands the sample to the kernel, where it survives the end of the
process (SIGKILL included), though not a power cut. `journal_to_recording` turns a journal, whole,
cut anywhere or damaged, into the HDF5 recording.

Layout, little-endian: one line `stagectl-journal 4 CRC {header as JSON}`, with the CRC-32 of the
header in hexadecimal, then records that start with a tag byte: `S`, uint32 index, a fixed-size
sample and the uint32 CRC-32 of all of it; or `J`, uint32 length, uint32 CRC-32 and that many bytes
of JSON (a move, an event, the outcome).
"""

from __future__ import annotations

import fcntl
import json
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stagectl.errors import StagectlError, UnusableInput, failure_to_write
from stagedata import Move

_MOVE = tuple(field.name for field in fields(Move))
FILE_NAME = "recording.journal"
MAGIC = b"stagectl-journal 4 "
SAMPLE_TAG = ord("S")
TEXT_TAG = ord("J")
TEXT_HEAD = struct.Struct("<BII")  # tag, length, CRC-32
CHECKSUM = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class AxisScaling:
    """Scaling of the raw integers of one axis.

    Attributes:
        name: of the axis.
        increment: one position count [m].
        force_unit: one count of force: rated force / 1000 [N].
    """

    name: str
    increment: float
    force_unit: float


@dataclass(frozen=True, slots=True)
class JournalHeader:
    """What is needed to interpret the samples.

    Attributes:
        machine: text of the machine file.
        recipe: text of the recipe, or "".
        started: ISO 8601 time with zone.
        axes: scaling of each axis, in the order of the sample tuples.
    """

    machine: str
    recipe: str
    started: str
    axes: tuple[AxisScaling, ...]


def sample_codec(axes: int) -> struct.Struct:
    """Codec of one sample record up to its CRC: tag, index, then the tuple that a sink gets.

    That is (time_ns, late, sync_ns, doubt_ns), then for each axis (target_counts, offset_permille,
    position_counts, force_permille, statusword, valid, arrival_ns, extra); arrival_ns < 0 where the
    TPDO was missed, doubt_ns < 0 where it is unknown.
    """
    return struct.Struct("<BIq?ii" + "ihihH?iB" * axes)


def sample_dtype(axes: int) -> np.dtype[np.void]:
    """The record of `axes` axes as a numpy type; fields of axis i end in `_i`."""
    fields = [("tag", "u1"), ("index", "<u4")]
    fields += [("time", "<i8"), ("late", "u1"), ("sync", "<i4"), ("doubt", "<i4")]
    for i in range(axes):
        fields += [
            (f"target_{i}", "<i4"),
            (f"offset_{i}", "<i2"),
            (f"position_{i}", "<i4"),
            (f"force_{i}", "<i2"),
            (f"statusword_{i}", "<u2"),
            (f"valid_{i}", "u1"),
            (f"arrival_{i}", "<i4"),
            (f"extra_{i}", "u1"),
        ]
    return np.dtype([*fields, ("crc", "<u4")])


def encode_header(header: JournalHeader) -> bytes:
    """The first line."""
    text = json.dumps(asdict(header)).encode()
    return MAGIC + b"%08x " % zlib.crc32(text) + text + b"\n"


@contextmanager
def locked_journal(path: Path) -> Iterator[BinaryIO]:
    """Open a journal for reading and lock it: its writer has ended, no one else recovers it.

    Raises:
        UnusableInput: it cannot be opened.
        StagectlError: the run is still in progress.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StagectlError(f"{path}: is being written by a run in progress") from None
        yield file


def refuse_in_progress(folder: Path) -> None:
    """Raise where a run is writing to a folder.

    Raises:
        StagectlError: it is; or its journal cannot be opened.
    """
    path = folder / FILE_NAME
    if path.exists():
        with locked_journal(path):
            pass


class Journal(AbstractContextManager["Journal"]):
    """The journal being written; the drivers call `sink` once per SYNC.

    Attributes:
        path: of the file.
        samples: number written, which is the index of the next one.
    """

    def __init__(self, folder: Path, header: JournalHeader) -> None:
        """Create `folder/recording.journal` and lock it for the life of this process.

        Raises:
            StagectlError: there is another journal, to be recovered first; or it cannot be written.
        """
        self.path = folder / FILE_NAME
        self.samples = 0
        self._pack = sample_codec(len(header.axes)).pack
        try:
            self._fd = os.open(
                self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, 0o644
            )
        except FileExistsError:
            raise StagectlError(
                f"{self.path}: the journal of another run; recover it first"
            ) from None
        except OSError as error:
            raise failure_to_write(f"{self.path}: cannot create", error) from error
        fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._write(encode_header(header))
        os.fsync(self._fd)

    def sink(self, sample: Sequence[int]) -> None:
        """Append one sample, a flat tuple of raw integers as in `sample_codec`.

        Raises:
            StagectlError: it cannot be written (disk full).
        """
        record = self._pack(SAMPLE_TAG, self.samples, *sample)
        self._write(record + CHECKSUM.pack(zlib.crc32(record)))
        self.samples += 1

    def move(self, move: Move) -> None:
        """Note a move, before its samples; another one with the same start replaces it."""
        self._text({"move": {name: getattr(move, name) for name in _MOVE}})

    def event(self, event: str, **data: object) -> None:
        """Note an event with the index of the next sample.

        Args:
            event: its name.
            data: JSON values, numpy scalars and arrays, dataclasses.
        """
        self._text({"event": {"event": event, "sample": self.samples, **data}})

    def note_outcome(self, outcome: str, fault: str | None = None) -> None:
        """Note how the run ended ("completed", "aborted", "fault")."""
        self._text({"outcome": outcome, "fault": fault})

    def finish(self, outcome: str, fault: str | None = None) -> None:
        """Note how the run ended, and close."""
        self.note_outcome(outcome, fault)
        self.close()

    def close(self) -> None:
        """Close the file; idempotent. Without an outcome the run counts as killed."""
        if self._fd >= 0:
            fd, self._fd = self._fd, -1
            os.close(fd)

    def __exit__(self, *_: object) -> None:
        self.close()

    def _text(self, record: dict[str, object]) -> None:
        body = _ENCODER.encode(record).encode()
        self._write(TEXT_HEAD.pack(TEXT_TAG, len(body), zlib.crc32(body)) + body)

    def _write(self, data: bytes) -> None:
        try:
            if os.write(self._fd, data) == len(data):
                return
        except OSError as error:
            raise StagectlError(f"{self.path}: cannot write: {error.strerror}") from error
        raise StagectlError(f"{self.path}: cannot write: the disk is full")


def _plain(value: object) -> object:
    """Values that JSON lacks, as plain ones; a note must not stop a run."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return str(value)


_ENCODER = json.JSONEncoder(default=_plain)
