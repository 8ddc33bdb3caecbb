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
import numpy.typing as npt

from stagectl.errors import UnusableInput
from stagectl.store.journal import (
    MAGIC,
    UNCHECKED_MAGIC,
    AxisScaling,
    JournalHeader,
    locked_journal,
)
from stagectl.store.journal_records import Records, Samples, fill_missing
from stagectl.store.ledger import CycleLedger
from stagectl.store.recording import RunNotes
from stagedata import AxisSignals, Move, Recording

KILLED = "killed"  # outcome of a run whose journal states none


@dataclass(frozen=True, slots=True, eq=False)
class JournalContent:
    """Content of a journal.

    Attributes:
        recording: samples and moves; moves end with the samples at the latest.
        ledger: punctuality of the cycles.
        events: each with its name `event` and the index `sample` of the next sample.
        outcome: "completed", "aborted", "fault", or "killed" where the journal states none.
        fault: text of the fault, or None.
        problem: what of the journal was damaged, or could not be checked, as a line; or None.
    """

    recording: Recording
    ledger: CycleLedger
    events: tuple[Mapping[str, Any], ...]
    outcome: str
    fault: str | None
    problem: str | None = None

    def notes(self) -> RunNotes:
        """All but the samples."""
        of = self.recording
        return RunNotes(of.recipe, of.machine, of.started, self.outcome, self.events, self.fault)


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
    header, records = start
    events: list[Mapping[str, Any]] = []
    outcome, fault = KILLED, None
    for record in records:
        if isinstance(record, np.ndarray):
            continue
        if "event" in record:
            events.append(record["event"])
        elif "outcome" in record:
            outcome, fault = record["outcome"], record["fault"]
    return RunNotes(header.recipe, header.machine, header.started, outcome, tuple(events), fault)


def _read_header(data: bytes, path: Path) -> tuple[JournalHeader, Records] | None:
    """The header and the records; None where the journal was cut before."""
    line_end = data.find(b"\n")
    checked = data.startswith(MAGIC[: len(data)])
    if not checked and not data.startswith(UNCHECKED_MAGIC):
        other = data.startswith(MAGIC.split(b" ")[0])
        problem = "a journal of another version: recover it with that" if other else "not a journal"
        raise UnusableInput(f"{path}: {problem}")
    if line_end < 0:
        return None
    text = data[len(MAGIC) : line_end]
    if checked:
        stated, _, text = text.partition(b" ")
        if stated != b"%08x" % zlib.crc32(text):
            raise UnusableInput(f"{path}: its header is damaged: its checksum is another")
    header = _header(text, path)
    return header, Records(data, line_end + 1, len(header.axes), checked=checked)


def parse_journal(data: bytes, path: Path) -> JournalContent | None:
    """The content of a journal, whole or cut anywhere.

    Args:
        data: its bytes.
        path: names it in messages.

    Returns:
        Its content; None where it was cut before the first sample.

    Raises:
        UnusableInput: it is not a journal.
    """
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
    if not blocks:
        return None
    samples = fill_missing(blocks, len(header.axes)) if records.checked else np.concatenate(blocks)
    problem = _describe_damage(records, len(samples) - sum(map(len, blocks)))
    if problem is not None:
        events.append({"event": "limitation", "sample": len(samples), "text": problem})
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
        problem=problem,
    )


def _describe_damage(records: Records, missing: int) -> str | None:
    """What of a journal was damaged or could not be checked."""
    problems = []
    if records.damaged:
        rest = "" if records.checked else "; what follows them is lost"
        lost = f", {missing} samples with them: lost like missed ones" if missing else ""
        problems.append(f"{records.damaged} bytes of the journal are damaged{lost}{rest}")
    if not records.checked:
        problems.append("an earlier version made the journal: its samples have no checksum")
    return "; ".join(problems) or None


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
        time=(samples["time"] - samples["time"][0]) * 1e-9,
        axes=axes,
        moves=tuple(
            replace(move, end=min(move.end, count))
            for start, move in sorted(moves.items())
            if start < count
        ),
        source=str(path),
    )


def _ledger(header: JournalHeader, samples: Samples) -> CycleLedger:
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
