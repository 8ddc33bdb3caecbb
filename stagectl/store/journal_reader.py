"""Reads a journal, whole, cut anywhere or damaged: every whole record (`journal_records`).

Layout: `journal`.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stagectl.errors import UnusableInput
from stagectl.store.cycle_ledger import CycleLedger
from stagectl.store.journal import MAGIC, AxisScaling, JournalHeader, locked_journal, sample_dtype
from stagectl.store.journal_records import Records, Samples, fill_missing
from stagectl.store.recording import RunNotes
from stagedata import F64, AxisSignals, Move, Recording

KILLED = "killed"  # outcome of a run whose journal states none


@dataclass(frozen=True, slots=True, eq=False)
class JournalContent:
    """Content of a journal.

    Attributes:
        recording: samples and moves; moves end with the samples at the latest.
        ledger: punctuality of the cycles.
        notes: all else; the outcome is "killed" where the journal states none.
        problem: what of the journal was damaged, as a line; or None.
    """

    recording: Recording
    ledger: CycleLedger
    notes: RunNotes
    problem: str | None = None


@dataclass(slots=True, eq=False)
class _Whole:
    """The whole records of a journal: blocks of samples, moves by their start, notes."""

    header: JournalHeader
    records: Records
    blocks: list[Samples]
    moves: dict[int, Move]
    notes: RunNotes


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
    whole = _read(data, path)
    return None if whole is None else whole.notes


def _read(data: bytes, path: Path) -> _Whole | None:
    start = _read_header(data, path)
    if start is None:
        return None
    header, records = start
    blocks: list[Samples] = []
    moves: dict[int, Move] = {}
    events: list[Mapping[str, Any]] = []
    outcome, fault = KILLED, None
    for record in records:
        if isinstance(record, np.ndarray):
            blocks.append(record)
        elif "move" in record:
            move = Move(**record["move"])
            moves[move.start] = move
        elif "event" in record:
            events.append(record["event"])
        elif "outcome" in record:
            outcome, fault = record["outcome"], record["fault"]
    notes = RunNotes(header.recipe, header.machine, header.started, outcome, tuple(events), fault)
    return _Whole(header, records, blocks, moves, notes)


def _read_header(data: bytes, path: Path) -> tuple[JournalHeader, Records] | None:
    """The header and the records; None where the journal was cut before."""
    line_end = data.find(b"\n")
    if not data.startswith(MAGIC[: len(data)]):
        other = data.startswith(MAGIC.split(b" ")[0])
        problem = "a journal of another version: recover it with that" if other else "not a journal"
        raise UnusableInput(f"{path}: {problem}")
    if line_end < 0:
        return None
    stated, _, text = data[len(MAGIC) : line_end].partition(b" ")
    if stated != b"%08x" % zlib.crc32(text):
        raise UnusableInput(f"{path}: its header is damaged: its checksum is another")
    header = _header(text, path)
    return header, Records(data, line_end + 1, len(header.axes))


def parse_journal(data: bytes, path: Path) -> JournalContent | None:
    """The content of a journal, whole or cut anywhere.

    Args:
        data: its bytes.
        path: names it in messages.

    Returns:
        Its content; None where it was cut within its header.

    Raises:
        UnusableInput: it is not a journal.
    """
    whole = _read(data, path)
    if whole is None:
        return None
    header, records, notes = whole.header, whole.records, whole.notes
    axes = len(header.axes)
    samples = np.zeros(0, sample_dtype(axes))
    if whole.blocks:
        samples = fill_missing(np.concatenate(whole.blocks), axes)
    missing, problem = len(samples) - sum(map(len, whole.blocks)), None
    if records.damaged:
        lost = f", {missing} samples with them: lost like missed ones" if missing else ""
        problem = f"{records.damaged} bytes of the journal are damaged{lost}"
        said = {"event": "limitation", "sample": len(samples), "text": problem}
        notes = replace(notes, events=(*notes.events, said))
    try:
        recording = _recording(header, samples, whole.moves, path)
    except ValueError as error:  # its header and moves contradict each other
        raise UnusableInput(f"{path}: it is damaged: {error}") from error
    return JournalContent(recording, _ledger(header, samples), notes, problem)


def _header(text: bytes, path: Path) -> JournalHeader:
    try:
        fields = json.loads(text)
        fields["axes"] = tuple(AxisScaling(**axis) for axis in fields["axes"])
        return JournalHeader(**fields)
    except (ValueError, TypeError, KeyError) as error:
        raise UnusableInput(f"{path}: its header is damaged: {error}") from error


def _recording(
    header: JournalHeader, samples: Samples, moves: Mapping[int, Move], path: Path
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
        time=(samples["time"] - samples["time"][:1]) * 1e-9,
        axes=axes,
        moves=tuple(
            replace(move, end=min(move.end, count))
            for start, move in sorted(moves.items())
            if start < count
        ),
        source=str(path),
    )


def _ledger(header: JournalHeader, samples: Samples) -> CycleLedger:
    arrival: dict[str, F64] = {}
    for i, axis in enumerate(header.axes):
        values = samples[f"arrival_{i}"] * 1e-9
        arrival[axis.name] = np.where(values < 0, np.nan, values)
    # A sample counts the extra TPDOs of the SYNC before it; after the last one none are counted.
    extra = {
        axis.name: np.append(samples[f"extra_{i}"][1:], 0)[: len(samples)].astype(np.uint8)
        for i, axis in enumerate(header.axes)
    }
    return CycleLedger(
        arrival=arrival,
        late=samples["late"].astype(np.bool_),
        extra=extra,
        sync=samples["sync"] * 1e-9,
        doubt=np.where(samples["doubt"] < 0, np.nan, samples["doubt"] * 1e-9),
    )
