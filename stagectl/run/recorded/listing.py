"""The runs in a folder, from their summaries; killed ones and those in progress by their journals.

Nothing is changed, and a run in progress is not disturbed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stagectl.errors import StagectlError, UnusableInput
from stagectl.plain_text import find_control, one_line
from stagectl.run.recorded.summarise import run_note
from stagectl.store import (
    FILE_NAME,
    RECORDING_NAME,
    RunNotes,
    read_journal_notes,
    read_notes,
    refuse_in_progress,
)

SUMMARY_NAME = "summary.json"


@dataclass(frozen=True, slots=True)
class ListedRun:
    """One run.

    Attributes:
        folder: of its files.
        started: ISO 8601 time with zone, or "".
        recipe, machine: names, or "".
        simulated: on virtual drives; None where unknown.
        lot, wafer, operator, comment: or None.
        outcome: "completed", "aborted", "fault", "killed", "running" or "unreadable".
        verdict: on the wafer: "pass", "fail" or "incomplete"; None without limits.
        unit: "site" or "move", of which `done` out of `of` are complete; None where unknown.
        reason: why it ended early or cannot be read, or None.
        settling: median of its micro-moves to the tightest window [s], or None.
        continues: folder of the run that it resumed, or None.
    """

    folder: Path
    started: str
    recipe: str
    machine: str
    simulated: bool | None
    lot: str | None
    wafer: str | None
    operator: str | None
    comment: str | None
    outcome: str
    verdict: str | None = None
    unit: str | None = None
    done: int | None = None
    of: int | None = None
    reason: str | None = None
    settling: float | None = None
    continues: str | None = None

    def __post_init__(self) -> None:
        texts = ("started", "recipe", "machine", "lot", "wafer", "operator", "comment", "outcome",
                 "verdict", "unit", "continues")  # fmt: skip
        for name in texts:
            value = getattr(self, name)
            if value is not None and not isinstance(value, str):
                raise ValueError(f"{name}: must be text")
            if (why := find_control(value or "")) is not None:
                raise ValueError(f"{name}: {why}")
        for name in ("done", "of"):
            if not isinstance(getattr(self, name), int | None):
                raise ValueError(f"{name}: must be a whole number")


def list_runs(folder: Path) -> list[ListedRun]:
    """The run in a folder, if it is one's; else those in its folders, oldest first.

    Raises:
        UnusableInput: there is no such folder.
    """
    if not folder.is_dir():
        raise UnusableInput(f"{folder}: no such folder")
    own = _run_in(folder)
    if own is not None:
        return [own]
    found = [run for path in sorted(folder.iterdir()) if (run := _run_in(path)) is not None]
    return sorted(found, key=lambda run: run.started)


def _run_in(folder: Path) -> ListedRun | None:
    """The run whose files are in a folder, or None; the journal of a later run comes first."""
    readers = {FILE_NAME: _of_journal, SUMMARY_NAME: _of_summary, RECORDING_NAME: _of_recording}
    for name, read in readers.items():
        path = folder / name
        if path.is_file():
            try:
                return read(path)
            except (StagectlError, OSError, KeyError, TypeError, ValueError, AttributeError) as why:
                return _unknown(folder, "unreadable", f"{path}: {why}")
    return None


def _unknown(folder: Path, outcome: str, reason: str | None = None) -> ListedRun:
    line = None if reason is None else one_line(reason, 400)
    return ListedRun(folder, "", "", "", None, None, None, None, None, outcome, reason=line)


def _of_summary(path: Path) -> ListedRun:
    summary = json.loads(path.read_text(encoding="utf-8"))
    stop: Mapping[str, Any] = summary.get("interrupted", {})
    return ListedRun(
        path.parent,
        str(summary.get("started", "")),
        summary["recipe"],
        summary["machine"],
        summary["simulated"],
        summary["lot"],
        summary.get("wafer"),
        summary.get("operator"),
        summary.get("comment"),
        summary["outcome"],
        summary.get("limits", {}).get("verdict"),
        stop.get("unit"),
        stop.get("done"),
        stop.get("of"),
        stop.get("reason") or summary["fault"],
        _tightest(summary.get("micro", {}).get("settling_median", {})),
        summary.get("resumed", {}).get("run"),
    )


def _tightest(settling: Mapping[str, float]) -> float | None:
    """The time to the tightest window."""
    return None if not settling else float(settling[min(settling, key=float)])


def _of_journal(path: Path) -> ListedRun:
    """A killed run, or one in progress, whose journal can be read all the same."""
    outcome = "killed"
    try:
        refuse_in_progress(path.parent)
    except UnusableInput:
        raise
    except StagectlError:
        outcome = "running"
    notes = read_journal_notes(path, locked=False)
    if notes is None or not notes.events:
        return _unknown(path.parent, outcome)
    return _of_notes(notes, path, outcome)


def _of_recording(path: Path) -> ListedRun:
    notes = read_notes(path)
    return _of_notes(notes, path, notes.outcome)


def _of_notes(notes: RunNotes, path: Path, outcome: str) -> ListedRun:
    run = run_note(notes, path)
    entry, resumed = run["history"], run["resumed"]
    done = [int(e["number"]) for e in notes.all("done")]
    return ListedRun(
        path.parent,
        notes.started,
        entry["recipe"],
        entry["stage"]["machine"],
        run["simulated"],
        entry["lot"],
        entry["wafer"],
        run.get("operator"),
        run.get("comment"),
        outcome,
        None,
        run.get("unit"),
        max(done, default=0 if resumed is None else resumed["done"]),
        run.get("stretches"),
        notes.fault,
        continues=None if resumed is None else resumed["run"],
    )
