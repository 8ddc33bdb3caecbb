"""Records that a history lacks, filed from the folders of the runs that made them.

A run may have been killed, or its history was locked, full or out of reach. What it made stands in
its recording, or in its journal as long as nobody has recovered that; filing it twice adds nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from stagectl.errors import StagectlError, UnusableInput
from stagectl.history.noted import NotedRun, noted_run
from stagectl.history.port import History
from stagectl.history.records import StageKey
from stagectl.store import FILE_NAME, RECORDING_NAME, RECOVERED_NAME, read_journal_notes, read_notes

BATCH = 500
"""So many estimates are filed in one transaction."""


def runs_in(folder: Path) -> list[NotedRun]:
    """The runs that a folder holds: that of its recording, and killed ones.

    Args:
        folder: of a run, or one of its recordings.

    Raises:
        UnusableInput: there is none, or it does not hold what a history needs.
        StagectlError: the run still goes on.
    """
    if folder.is_file():
        return [noted_run(read_notes(folder), folder)]
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


def _read(path: Path) -> NotedRun | None:
    """A run out of its recording or journal; None where that was cut before it said anything."""
    if path.name != FILE_NAME:
        return noted_run(read_notes(path), path)
    notes = read_journal_notes(path)
    return None if notes is None or not notes.events else noted_run(notes, path)


def file_run(history: History, run: NotedRun) -> int:
    """File all that a run has made; returns how many of its estimates were missing.

    Args:
        history: open for writing.
        run: as its recording has it.

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


def file_left_behind(history: History, stage: StageKey) -> Iterator[str]:
    """File what the stage's earlier runs have left; yields a line on each that had something.

    Runs whose folder is elsewhere now, or on another computer, wait for an import.

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
            except StagectlError:  # it still goes on
                continue
            if run is not None and run.entry.uuid == uuid:
                added = file_run(history, run)
                if added:
                    yield f"{added} estimates filed that an earlier run left in {name}"
                break
