"""Converts a journal to the HDF5 recording, of an interrupted run as of one that ended."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from stagectl.errors import UnusableInput
from stagectl.store.bus_log import recover_log
from stagectl.store.journal import FILE_NAME, locked_journal, refuse_in_progress
from stagectl.store.journal_reader import JournalContent, parse_journal
from stagectl.store.recording import write_recording
from stagectl.store.recording_blocks import read_recording
from stagedata import Recording

RECORDING_NAME = "recording.h5"
MOVED_BY_PROFILE = "moved_by_profile"
"""Event of a run whose drives' demand was not sent to them, but made by themselves (pp)."""
RECOVERED_NAME = "recording-recovered.h5"
"""Name for a killed run's recording where another run is about to write its own."""


def recording_in(path: Path) -> Path:
    """The recording that a path stands for: itself, or that of the run whose folder it is.

    Raises:
        UnusableInput: a folder without one; `recover` makes that of a killed run.
        StagectlError: a folder whose run is still in progress.
    """
    if not path.is_dir():
        return path
    found = path / RECORDING_NAME
    if found.exists():
        return found
    if (path / FILE_NAME).exists():
        refuse_in_progress(path)
        raise UnusableInput(
            f"{path}: its run was killed; 'stagectl recover {shlex.quote(str(path))}' makes "
            f"{RECORDING_NAME}"
        )
    raise UnusableInput(f"{path}: holds no {RECORDING_NAME}")


@dataclass(frozen=True, slots=True, eq=False)
class Recovered:
    """A journal converted to a recording.

    Attributes:
        path: of the recording; None where the journal held no sample.
        content: of the journal; None where it was cut within its header.
    """

    path: Path | None
    content: JournalContent | None

    def describe(self) -> str:
        """One line for the operator."""
        if self.path is None or self.content is None:
            return "an interrupted run left a journal without samples; it was removed"
        count, problem = len(self.content.recording), self.content.problem
        line = f"an interrupted run left a journal; its {count} samples are now {self.path}"
        return line if problem is None else f"{line} ({problem})"


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
            content = parse_journal(file.read(), path)
            target = None
            if content is not None and len(content.recording):
                target = path.with_name(name)
                if not overwrite:
                    target = _free_name(target, content.recording)
                whole = replace(content.recording, source=str(target))
                if content.notes.all(MOVED_BY_PROFILE):
                    whole = _without_demand(whole)
                content = replace(content, recording=whole)
                write_recording(content.recording, target, content.ledger, content.notes)
            path.unlink()
    except OSError as error:
        raise UnusableInput(f"{path}: {error.strerror}") from error
    return Recovered(target, content)


def _without_demand(recording: Recording) -> Recording:
    """The recording of drives that moved by their own profiles: only the targets are known."""
    axes = {
        name: replace(signals, missing=("position_demand",))
        for name, signals in recording.axes.items()
    }
    return replace(recording, axes=axes)


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
