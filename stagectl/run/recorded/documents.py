"""Summary and report of a run: written when it ends, and again from its recording.

The page of a calibration is `stagectl.calibration`'s.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from stagectl import store
from stagectl.config.machine import Machine
from stagectl.config.machine.file import parse_machine
from stagectl.errors import UnusableInput
from stagectl.report import render_report
from stagectl.run.recorded.summarise import run_note, summarise
from stagedata import Recording


def document_paths(recording: Path) -> tuple[Path, Path]:
    """Paths of summary and report; those of `recording-recovered.h5` end in `-recovered`, too."""
    usual = Path(store.RECORDING_NAME).stem
    stem = recording.stem
    suffix = stem.removeprefix(usual) if stem.startswith(usual) else f"-{stem}"
    return (
        recording.with_name(f"summary{suffix}.json"),
        recording.with_name(f"report{suffix}.html"),
    )


def write_documents(
    notes: store.RunNotes,
    recording: Recording,
    ledger: store.CycleLedger | None,
    machine: Machine,
    path: Path,
) -> dict[str, Any]:
    """Write the summary, and a production run's report if there are samples.

    Arguments as for `summarise`.

    Returns:
        The summary.

    Raises:
        UnusableInput: an older version made the recording, or its events are damaged.
        StagectlError: a file cannot be written.
    """
    summary = summarise(notes, recording, ledger, machine, path)
    summary_path, report_path = document_paths(path)
    text = json.dumps(summary, indent=1, allow_nan=False) + "\n"
    store.write_atomically(summary_path, text, "summary")
    if len(recording) and not run_note(notes, path).get("calibration"):
        control_period = next(iter(machine.axes.values())).drive.control_period
        told = [e["text"] for e in notes.all("limitation")]
        page = render_report(recording, summary, control_period=control_period, notices=told)
        store.write_atomically(report_path, page, "report")
    return summary


def is_calibration(path: Path) -> bool:
    """Whether a recording is of a calibration.

    Raises:
        UnusableInput: it cannot be read, or is not of a run by this version.
    """
    return bool(run_note(store.read_notes(path), path).get("calibration"))


def rewrite_documents(path: Path) -> tuple[dict[str, Any], tuple[Path, ...]]:
    """Make summary and report again from a recording; of a calibration only the summary.

    Args:
        path: of the recording, or the folder of its run.

    Returns:
        The summary; the paths of what was written.

    Raises:
        UnusableInput: there is no recording, or not one of a run by this version.
        ConfigError: its machine file cannot be used any more.
        StagectlError: a file cannot be written.
    """
    found = store.recording_in(path)
    if not found.exists():
        raise UnusableInput(f"{path}: no such run")
    notes, recording, machine = read_run(found)
    summary = write_documents(notes, recording, store.read_ledger(found), machine, found)
    return summary, document_paths(found)[: 1 if is_calibration(found) else 2]


def read_run(path: Path) -> tuple[store.RunNotes, Recording, Machine]:
    """Read a recording of a run, with its machine.

    Raises:
        UnusableInput: it cannot be read, or is not of a run by this version.
        ConfigError: its machine file cannot be used any more.
    """
    notes = store.read_notes(path)
    run = run_note(notes, path)
    source = str(run.get("files", {}).get("machine", path))
    return notes, store.read_recording(path), parse_machine(notes.machine, source)
