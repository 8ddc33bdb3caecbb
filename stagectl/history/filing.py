"""Files records that a history lacks from the folders of their runs.

A run may have been killed, or its history locked, full or out of reach. Its records are in its
recording, or in its journal until that is recovered, as notes: the event `run` holds the run's row
of the history, each event `friction` that of an estimate, and `level_stepped` that of a step
(docs/formats/recording.md). Filing them twice adds nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from stagectl import store
from stagectl.errors import StagectlError, UnusableInput
from stagectl.history.records import EstimateRecord, RunEntry, StageKey, StepRecord
from stagectl.history.sql import History

BATCH = 500
"""Estimates filed per transaction."""
_IN_EVENT = ("run", "axis", "site", "accepted", "reason")
"""Fields of an estimate that its event has anyway, or that only the database knows."""
_ENTRY, _ESTIMATE = TypeAdapter(RunEntry), TypeAdapter(EstimateRecord)
_NOTED = tuple(f.name for f in fields(EstimateRecord) if f.name not in _IN_EVENT)


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The records of a run, from its recording.

    Attributes:
        entry: of the run.
        where: history that it used, without a password; None for none.
        estimates, steps: all of them in order, with run number 0.
        outcome: None where the run was killed.
        fault: its text.
    """

    entry: RunEntry
    where: str | None
    estimates: tuple[EstimateRecord, ...]
    steps: tuple[StepRecord, ...]
    outcome: str | None
    fault: str | None


def note_of_run(entry: RunEntry, where: str | None) -> dict[str, Any]:
    """The note in the event `run`."""
    return {"where": where, **asdict(entry)}


def note_of_estimate(record: EstimateRecord) -> dict[str, Any]:
    """The note in the event `friction`."""
    return {name: getattr(record, name) for name in _NOTED}


def step_record(event: Mapping[str, Any], entry: RunEntry, number: int) -> StepRecord:
    """A step of the level as a row of the history.

    Args:
        event: fields of a `LevelStepped`.
        entry: the run.
        number: of the step in the run, from 1.
    """
    x, y = event["place"]
    return StepRecord(
        0, str(event["axis"]), (float(x), float(y)), entry.started + float(event["time"]),
        float(event["change"]), "common" if event["everywhere"] else "site", number,
    )  # fmt: skip


def recorded_run(notes: store.RunNotes, path: Path) -> RecordedRun:
    """The records of a run from its notes.

    Args:
        notes: of its recording, or of the journal of a killed run.
        path: they were read from, for errors.

    Raises:
        UnusableInput: an older version wrote them without records, or they are damaged.
    """
    run = notes.last("run")
    if "history" not in run:
        raise UnusableInput(
            f"{path}: lacks the records that a history needs (made by an older version)"
        )
    with store.reading_events(path):
        entry = _ENTRY.validate_python(run["history"])
        where = run["history"]["where"]
        return RecordedRun(
            entry,
            None if where is None else str(where),
            tuple(map(_estimate, notes.all("friction"))),
            tuple(step_record(e, entry, n) for n, e in enumerate(notes.all("level_stepped"), 1)),
            None if notes.outcome in ("", "killed") else notes.outcome,
            notes.fault,
        )


def _estimate(event: Mapping[str, Any]) -> EstimateRecord:
    own = {name: event[name] for name in _IN_EVENT if name != "run"}
    return _ESTIMATE.validate_python({**event["record"], **own, "run": 0})


def runs_in(folder: Path) -> list[RecordedRun]:
    """The runs in a folder: that of its recording, and killed ones.

    Args:
        folder: of a run, or the path of a recording.

    Raises:
        UnusableInput: there is none, or it lacks what a history needs.
        StagectlError: the run is still in progress.
    """
    if folder.is_file():
        return [recorded_run(store.read_notes(folder), folder)]
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: no such folder")
    found = [run for run in map(_read, _files(folder)) if run is not None]
    if not found:
        raise UnusableInput(f"{folder}: holds no recording")
    return found


def _files(folder: Path) -> list[Path]:
    """Recordings and journals in a folder."""
    recovered = Path(store.RECOVERED_NAME)
    names = (store.RECORDING_NAME, f"{recovered.stem}*{recovered.suffix}", store.FILE_NAME)
    return [path for name in names for path in sorted(folder.glob(name))]


def _read(path: Path) -> RecordedRun | None:
    """The run of a recording or journal; None where that was cut before its first note."""
    if path.name != store.FILE_NAME:
        return recorded_run(store.read_notes(path), path)
    notes = store.read_journal_notes(path)
    return None if notes is None or not notes.events else recorded_run(notes, path)


def file_run(history: History, run: RecordedRun) -> int:
    """File all records of a run; returns the number of estimates that were missing.

    Args:
        history: open for writing.
        run: as read from its recording.

    Raises:
        StagectlError: the history cannot be written.
    """
    number = history.start_run(run.entry)
    before = history.filed(number)
    estimates = [replace(record, run=number) for record in run.estimates]
    for begin in range(0, len(estimates), BATCH):
        history.add(estimates[begin : begin + BATCH])
    for step in run.steps:
        history.add_step(replace(step, run=number))
    history.end_run(number, run.outcome, run.fault, len(estimates))
    return history.filed(number) - before


def file_unfiled_runs(history: History, stage: StageKey) -> Iterator[str]:
    """File what earlier runs of the stage could not; yields a line for each with something to file.

    Runs whose folder has moved, or is on another computer, have to be imported.

    Args:
        history: open for writing.
        stage: whose.

    Raises:
        StagectlError: the history cannot be written.
    """
    for uuid, name in history.unfiled(stage):
        for path in (*_files(Path(name)), *_files(Path(name) / "previous")):
            try:
                run = _read(path)
            except UnusableInput as error:
                yield f"not filed in the history: {error}"
                continue
            except StagectlError:  # still in progress
                continue
            if run is not None and run.entry.uuid == uuid:
                added = file_run(history, run)
                if added:
                    yield f"{added} estimates filed that an earlier run left in {name}"
                break
