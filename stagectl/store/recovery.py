"""From a journal to the HDF5 recording, also when the journal was cut anywhere.

Everything up to the first record that is not whole is taken; what follows it is dropped, since
nothing can be after a cut. A run that ends regularly takes the same way. Layout: journal.py.
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
    claimed,
    sample_dtype,
)
from stagectl.store.ledger import CycleLedger
from stagectl.store.recording import RunNotes, read_recording, write_recording
from stagedata import AxisSignals, Move, Recording

RECORDING_NAME = "recording.h5"
RECOVERED_NAME = "recording-recovered.h5"
"""Of a killed run's recording, where another run is about to write its own."""
KILLED = "killed"  # the outcome of a run whose journal does not tell

_BLOCK = 8192  # records looked at at once while the end of a run of samples is sought


@dataclass(frozen=True, slots=True, eq=False)
class JournalContent:
    """What a journal holds.

    Attributes:
        recording: the samples and moves; moves are cut where the samples end.
        ledger: punctuality of the cycles.
        events: as they were noted, each with its name `event` and the `sample` it came before.
        outcome: "completed", "aborted", "fault", or "killed" when the journal just ends.
        fault: text of the fault, or None.
    """

    recording: Recording
    ledger: CycleLedger
    events: tuple[Mapping[str, Any], ...]
    outcome: str
    fault: str | None


@dataclass(frozen=True, slots=True, eq=False)
class Recovered:
    """A journal that has become a recording.

    Attributes:
        path: of the recording, or None when the journal held no sample.
        content: what it held, or None when it held no sample.
    """

    path: Path | None
    content: JournalContent | None

    def describe(self) -> str:
        """One line for the operator."""
        if self.path is None or self.content is None:
            return "an interrupted run left a journal without samples; removed"
        count = len(self.content.recording)
        return f"an interrupted run left a journal; its {count} samples are now {self.path}"


def read_journal(path: Path) -> JournalContent | None:
    """Read a journal, whole or cut anywhere.

    Returns:
        Its content, or None when it was cut before the first sample.

    Raises:
        UnusableInput: it is not a journal.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    return _parse(data, path)


def recover(path: Path, *, name: str = RECORDING_NAME, overwrite: bool = False) -> Recovered:
    """Turn a journal into a recording beside it and remove the journal.

    Args:
        path: of the journal.
        name: of the recording.
        overwrite: replace whatever has that name. Otherwise the recording of another run is left
            alone and a number is added to the name.

    Raises:
        UnusableInput: it is not a journal.
        StagectlError: the run still goes on, or the recording cannot be written.
    """
    try:
        with claimed(path) as file:
            content = _parse(file.read(), path)
            target = None
            if content is not None:
                target = path.with_name(name)
                if not overwrite:
                    target = _free(target, content.recording)
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
    """Recover the journal that an interrupted run left in a folder, if there is one.

    Args:
        folder: where a run writes.
        aside: a new run is about to write `recording.h5` there: use another name.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    return recover(path, name=RECOVERED_NAME if aside else RECORDING_NAME)


def recover_folder(folder: Path) -> tuple[Recovered | None, Path | None]:
    """Recover all that an interrupted run left in a folder: its journal, then its bus log.

    Returns:
        What became of the journal, and the path of the bus log; None where there was none.

    Raises:
        UnusableInput: one of them is something else.
        StagectlError: the run still goes on, and nothing is touched; or a file cannot be written.
    """
    return recover_left_over(folder), recover_log(folder)


def _free(target: Path, recording: Recording) -> Path:
    """`target`, or with a number where that is the recording of another run."""
    candidate, number = target, 1
    while candidate.exists() and not _same_run(candidate, recording):
        number += 1
        candidate = target.with_name(f"{target.stem}-{number}{target.suffix}")
    return candidate


def _same_run(path: Path, recording: Recording) -> bool:
    # A kill between the writing of a recording and the removal of its journal leaves both.
    try:
        other = read_recording(path)
    except UnusableInput:
        return False
    return (other.started, len(other)) == (recording.started, len(recording))


def read_journal_notes(path: Path) -> RunNotes | None:
    """What a run that was killed noted beside its samples; its journal stays as it is.

    Returns:
        Its notes, or None when it was cut before the first of them.

    Raises:
        UnusableInput: it is not a journal.
        StagectlError: the run still goes on.
    """
    with claimed(path):  # not while it is read: who recovers it must not find it claimed
        pass
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    begun = _begin(data, path)
    if begun is None:
        return None
    header, at = begun
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


def _begin(data: bytes, path: Path) -> tuple[JournalHeader, int] | None:
    """The header, and where the records begin; None when it was cut before that."""
    line_end = data.find(b"\n")
    if not data.startswith(MAGIC[: len(data)]):
        other = data.startswith(MAGIC.split(b" ")[0])
        problem = "a journal of another version: recover it with that" if other else "not a journal"
        raise UnusableInput(f"{path}: {problem}{'' if other else ' of ours'}")
    if line_end < 0:
        return None
    return _header(data[len(MAGIC) : line_end], path), line_end + 1


def _parse(data: bytes, path: Path) -> JournalContent | None:
    begun = _begin(data, path)
    if begun is None:
        return None
    header, at = begun
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
    except ValueError as error:  # header and moves contradict each other
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
    """Runs of samples and texts in order, up to the first record that is not whole."""
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
            # zeros where a text was have the checksum of no text at all
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
    # a sample tells what came besides for the SYNC before it; nobody looked after the last one
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
