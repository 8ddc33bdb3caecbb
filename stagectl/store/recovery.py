"""Converts a journal, whole or cut anywhere, to the HDF5 recording.

Everything up to the first incomplete record is used. A run that ends regularly makes its recording
in the same way. Layout: `journal`.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput
from stagectl.store.bus_log import recover_log
from stagectl.store.journal import (
    FILE_NAME,
    MAGIC,
    SAMPLE_TAG,
    TEXT_HEAD,
    TEXT_TAG,
    AxisScaling,
    JournalHeader,
    locked_journal,
    sample_dtype,
)
from stagectl.store.ledger import CycleLedger
from stagectl.store.recording import RunNotes, read_recording, write_recording
from stagedata import AxisSignals, Move, Recording

RECORDING_NAME = "recording.h5"
RECOVERED_NAME = "recording-recovered.h5"
"""Name for a killed run's recording where another run is about to write its own."""
KILLED = "killed"  # outcome of a run whose journal states none

_BLOCK = 8192  # records examined at once


@dataclass(frozen=True, slots=True, eq=False)
class JournalContent:
    """Content of a journal.

    Attributes:
        recording: samples and moves; moves end with the samples at the latest.
        ledger: punctuality of the cycles.
        events: each with its name `event` and the index `sample` of the next sample.
        outcome: "completed", "aborted", "fault", or "killed" where the journal states none.
        fault: text of the fault, or None.
    """

    recording: Recording
    ledger: CycleLedger
    events: tuple[Mapping[str, Any], ...]
    outcome: str
    fault: str | None

    def notes(self) -> RunNotes:
        """All but the samples."""
        of = self.recording
        return RunNotes(of.recipe, of.machine, of.started, self.outcome, self.events, self.fault)


@dataclass(frozen=True, slots=True, eq=False)
class Recovered:
    """A journal converted to a recording.

    Attributes:
        path: of the recording; None where the journal held no sample.
        content: of the journal; None where it held no sample.
    """

    path: Path | None
    content: JournalContent | None

    def describe(self) -> str:
        """One line for the operator."""
        if self.path is None or self.content is None:
            return "an interrupted run left a journal without samples; it was removed"
        count = len(self.content.recording)
        return f"an interrupted run left a journal; its {count} samples are now {self.path}"


def read_journal(path: Path) -> JournalContent | None:
    """Read a journal, whole or cut anywhere.

    Returns:
        Its content; None where it was cut before the first sample.

    Raises:
        UnusableInput: it is not a journal.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    return _parse(data, path)


def recover_journal(
    path: Path, *, name: str = RECORDING_NAME, overwrite: bool = False
) -> Recovered:
    """Convert a journal to a recording beside it and remove the journal.

    Args:
        path: of the journal.
        name: of the recording.
        overwrite: replace a file of that name; else the recording of another run is kept, and a
            number is added to the name.

    Raises:
        UnusableInput: it is not a journal.
        StagectlError: the run is still in progress, or the recording cannot be written.
    """
    try:
        with locked_journal(path) as file:
            content = _parse(file.read(), path)
            target = None
            if content is not None:
                target = path.with_name(name)
                if not overwrite:
                    target = _free_name(target, content.recording)
                content = replace(content, recording=replace(content.recording, source=str(target)))
                write_recording(
                    content.recording,
                    target,
                    content.ledger,
                    events=content.events,
                    outcome=content.outcome,
                    fault=content.fault,
                )
            path.unlink()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    return Recovered(target, content)


def recover_left_over(folder: Path, *, aside: bool = False) -> Recovered | None:
    """Recover the journal that an interrupted run left in a folder.

    Args:
        folder: of a run.
        aside: use another name, for a new run is about to write `recording.h5` there.

    Returns:
        None where there is no journal.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    return recover_journal(path, name=RECOVERED_NAME if aside else RECORDING_NAME)


def recover_folder(folder: Path) -> tuple[Recovered | None, Path | None]:
    """Recover journal and bus log that an interrupted run left in a folder.

    Returns:
        The recovered journal and the path of the bus log; None where there was none.

    Raises:
        UnusableInput: a file of that name is something else.
        StagectlError: the run is still in progress, or a file cannot be written.
    """
    return recover_left_over(folder), recover_log(folder)


def _free_name(target: Path, recording: Recording) -> Path:
    """`target`, with a number where that is the recording of another run."""
    candidate, number = target, 1
    while candidate.exists() and not _same_run(candidate, recording):
        number += 1
        candidate = target.with_name(f"{target.stem}-{number}{target.suffix}")
    return candidate


def _same_run(path: Path, recording: Recording) -> bool:
    # A kill between writing a recording and removing its journal leaves both.
    try:
        other = read_recording(path)
    except UnusableInput:
        return False
    return (other.started, len(other)) == (recording.started, len(recording))


def read_journal_notes(path: Path, *, locked: bool = True) -> RunNotes | None:
    """Read the notes of a killed run from its journal, which stays as it is.

    Args:
        path: of the journal.
        locked: refuse that of a run in progress; else its notes so far are read.

    Returns:
        Its notes; None where it was cut before the first of them.

    Raises:
        UnusableInput: it is not a journal.
        StagectlError: the run is still in progress.
    """
    if locked:
        with locked_journal(path):  # not while reading: a recovery must not find it locked
            pass
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    start = _read_header(data, path)
    if start is None:
        return None
    header, at = start
    events: list[Mapping[str, Any]] = []
    outcome, fault = KILLED, None
    for record in _records(data, at, sample_dtype(len(header.axes))):
        if isinstance(record, np.ndarray):
            continue
        if "event" in record:
            events.append(record["event"])
        elif "outcome" in record:
            outcome, fault = record["outcome"], record["fault"]
    return RunNotes(header.recipe, header.machine, header.started, outcome, tuple(events), fault)


def _read_header(data: bytes, path: Path) -> tuple[JournalHeader, int] | None:
    """The header and the position of the records; None where the journal was cut before."""
    line_end = data.find(b"\n")
    if not data.startswith(MAGIC[: len(data)]):
        other = data.startswith(MAGIC.split(b" ")[0])
        problem = "a journal of another version: recover it with that" if other else "not a journal"
        raise UnusableInput(f"{path}: {problem}")
    if line_end < 0:
        return None
    return _header(data[len(MAGIC) : line_end], path), line_end + 1


def _parse(data: bytes, path: Path) -> JournalContent | None:
    start = _read_header(data, path)
    if start is None:
        return None
    header, at = start
    dtype = sample_dtype(len(header.axes))
    blocks: list[npt.NDArray[np.void]] = []
    moves: dict[int, Move] = {}
    events: list[Mapping[str, Any]] = []
    outcome, fault = KILLED, None
    for record in _records(data, at, dtype):
        if isinstance(record, np.ndarray):
            blocks.append(record)
        elif "move" in record:
            move = Move(**record["move"])
            moves[move.start] = move
        elif "event" in record:
            events.append(record["event"])
        elif "outcome" in record:
            outcome, fault = record["outcome"], record["fault"]
    if not blocks:
        return None
    samples = np.concatenate(blocks)
    try:
        recording = _recording(header, samples, moves, path)
    except ValueError as error:  # its header and moves contradict each other
        raise UnusableInput(f"{path}: it is damaged: {error}") from error
    return JournalContent(
        recording=recording,
        ledger=_ledger(header, samples),
        events=tuple(events),
        outcome=outcome,
        fault=fault,
    )


def _header(text: bytes, path: Path) -> JournalHeader:
    try:
        fields = json.loads(text)
        fields["axes"] = tuple(AxisScaling(**axis) for axis in fields["axes"])
        return JournalHeader(**fields)
    except (ValueError, TypeError, KeyError) as error:
        raise UnusableInput(f"{path}: its header is damaged: {error}") from error


def _records(
    data: bytes, at: int, dtype: np.dtype[np.void]
) -> Iterator[npt.NDArray[np.void] | dict[str, Any]]:
    """Blocks of samples, and notes, in order up to the first incomplete record."""
    while at < len(data):
        if data[at] == SAMPLE_TAG:
            count = min((len(data) - at) // dtype.itemsize, _BLOCK)
            if count == 0:
                return
            block = np.frombuffer(data, dtype=dtype, count=count, offset=at)
            others = np.flatnonzero(block["tag"] != SAMPLE_TAG)
            if len(others):
                block = block[: others[0]]
            yield block
            at += len(block) * dtype.itemsize
        elif data[at] == TEXT_TAG and at + TEXT_HEAD.size <= len(data):
            _, length, checksum = TEXT_HEAD.unpack_from(data, at)
            at += TEXT_HEAD.size
            body = data[at : at + length]
            # Zeros in place of a note have the checksum of an empty one.
            if not length or len(body) < length or zlib.crc32(body) != checksum:
                return
            yield json.loads(body)
            at += length
        else:
            return


def _recording(
    header: JournalHeader, samples: npt.NDArray[np.void], moves: Mapping[int, Move], path: Path
) -> Recording:
    count = len(samples)
    axes = {
        axis.name: AxisSignals(
            position_demand=samples[f"target_{i}"] * axis.increment,
            force_offset=samples[f"offset_{i}"] * axis.force_unit,
            position_actual=samples[f"position_{i}"] * axis.increment,
            force_actual=samples[f"force_{i}"] * axis.force_unit,
            statusword=samples[f"statusword_{i}"].astype(np.uint16),
            valid=samples[f"valid_{i}"].astype(np.bool_),
        )
        for i, axis in enumerate(header.axes)
    }
    return Recording(
        machine=header.machine,
        recipe=header.recipe,
        started=header.started,
        time=(samples["time"] - samples["time"][0]) * 1e-9,
        axes=axes,
        moves=tuple(
            replace(move, end=min(move.end, count))
            for start, move in sorted(moves.items())
            if start < count
        ),
        source=str(path),
    )


def _ledger(header: JournalHeader, samples: npt.NDArray[np.void]) -> CycleLedger:
    arrival: dict[str, npt.NDArray[np.float64]] = {}
    for i, axis in enumerate(header.axes):
        values = samples[f"arrival_{i}"] * 1e-9
        arrival[axis.name] = np.where(values < 0, np.nan, values)
    # A sample counts the extra TPDOs of the SYNC before it; after the last one none are counted.
    extra = {
        axis.name: np.append(samples[f"extra_{i}"][1:], 0).astype(np.uint8)
        for i, axis in enumerate(header.axes)
    }
    return CycleLedger(
        arrival=arrival,
        late=samples["late"].astype(np.bool_),
        extra=extra,
        sync=samples["sync"] * 1e-9,
        doubt=np.where(samples["doubt"] < 0, np.nan, samples["doubt"] * 1e-9),
    )
