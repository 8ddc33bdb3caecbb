"""Files records that a history lacks from the folders of their runs.

A run may have been killed, or its history locked, full or out of reach. Its records are in its
recording, or in its journal until that is recovered. Filing them twice adds nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from stagectl.errors import StagectlError, UnusableInput
from stagectl.history.notes import RecordedRun, recorded_run
from stagectl.history.port import History
from stagectl.history.records import StageKey
from stagectl.store import FILE_NAME, RECORDING_NAME, RECOVERED_NAME, read_journal_notes, read_notes

BATCH = 500
"""Estimates filed per transaction."""


def runs_in(folder: Path) -> list[RecordedRun]:
    """The runs in a folder: that of its recording, and killed ones.

    Args:
        folder: of a run, or the path of a recording.

    Raises:
        UnusableInput: there is none, or it lacks what a history needs.
        StagectlError: the run is still in progress.
    """
    if folder.is_file():
        return [recorded_run(read_notes(folder), folder)]
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: no such folder")
    found = [run for run in map(_read, _files(folder)) if run is not None]
    if not found:
        raise UnusableInput(f"{folder}: holds no recording")
    return found


def _files(folder: Path) -> list[Path]:
    """Recordings and journals in a folder."""
    recovered = Path(RECOVERED_NAME)
    names = (RECORDING_NAME, f"{recovered.stem}*{recovered.suffix}", FILE_NAME)
    return [path for name in names for path in sorted(folder.glob(name))]


def _read(path: Path) -> RecordedRun | None:
    """The run of a recording or journal; None where that was cut before its first note."""
    if path.name != FILE_NAME:
        return recorded_run(read_notes(path), path)
    notes = read_journal_notes(path)
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
