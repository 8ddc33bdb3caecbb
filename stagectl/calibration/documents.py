"""What a calibration's recording says; its summary and page, made again from it.

The recording does not hold the map that was built at its end: the sites' levels are those of the
estimates, and nothing is compared with the map before.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from stagectl.calibration.outcome import site_outcomes, visited_sites
from stagectl.calibration.page import CalibrationReport, write_calibration_page
from stagectl.calibration.sites import recorded_sequence
from stagectl.config.machine.file import parse_machine
from stagectl.errors import UnusableInput
from stagectl.history import StageKey
from stagectl.recipe import Pair
from stagectl.report import friction_map_used
from stagectl.run import document_paths, is_calibration, rewrite_documents
from stagectl.store import RECORDING_NAME, RunNotes, read_notes, reading_events, recording_in


@dataclass(frozen=True, slots=True)
class RecordedCalibration:
    """A calibration, complete or interrupted.

    Attributes:
        sites: in the order of the visit, including the repeated first one at the end [m].
        friction: estimates so far, those of the calibration it resumed included, as entries of a
            summary.
    """

    sites: tuple[Pair, ...]
    friction: tuple[dict[str, Any], ...]


def read_calibration(path: Path) -> RecordedCalibration:
    """Read the recording of a calibration.

    Raises:
        UnusableInput: the run was not a calibration, or is of an older version.
    """
    notes = read_notes(path)
    run = notes.last("run")
    if not run.get("sites"):
        raise UnusableInput(f"{path}: not a calibration, or one of an older version")
    with reading_events(path):
        sites = tuple((float(x), float(y)) for x, y in run["sites"])
        before: tuple[dict[str, Any], ...] = ()
        if run["resumed"] is not None:
            earlier = Path(str(run["resumed"]["run"]))
            if (earlier / RECORDING_NAME).exists():  # it may have been deleted
                before = read_calibration(earlier / RECORDING_NAME).friction
        return RecordedCalibration(sites, (*before, *_friction(notes)))


def _friction(notes: RunNotes) -> list[dict[str, Any]]:
    return [
        {
            "site": event["site"], "axis": event["axis"], "accepted": event["accepted"],
            "reason": event["reason"],
            "parameters": {
                name: {"value": float(pair[0]), "sigma": float(pair[1])}
                for name, pair in event["parameters"].items()
            },
        }
        for event in notes.all("friction")
    ]  # fmt: skip


def rewrite_all_documents(path: Path) -> tuple[dict[str, Any], tuple[Path, ...]]:
    """Make summary and page of a run again, or those of a calibration.

    Args:
        path: of the recording, or the folder of its run.

    Returns:
        The summary; the paths of what was written.

    Raises:
        UnusableInput: there is no recording, or not one of a run by this version.
        ConfigError: its machine or calibration file cannot be used any more.
        StagectlError: a file cannot be written.
    """
    summary, written = rewrite_documents(path)
    recording = recording_in(path)
    if is_calibration(recording):
        page = document_paths(recording)[1]
        write_calibration_page(page, _recorded_report(recording, summary))
        written = (*written, page)
    return summary, written


def _recorded_report(path: Path, summary: dict[str, Any]) -> CalibrationReport:
    notes, recorded = read_notes(path), read_calibration(path)
    machine = parse_machine(notes.machine, str(path))
    sites = recorded.sites
    if notes.outcome != "completed":
        sites = visited_sites(sites, recorded.friction)
    return CalibrationReport(
        summary["recipe"],
        str(StageKey(summary["machine"], summary["simulated"])),
        f"{datetime.fromisoformat(notes.started):%Y-%m-%d %H:%M:%S %Z}",
        notes.fault,
        friction_map_used(summary),
        len(sites),
        len(recorded.sites),
        site_outcomes(sites, recorded.friction, tuple(machine.axes), None, ()),
        (),
        recorded_sequence(notes.recipe, str(path), machine),
        None,
        None,
        is_from_recording=True,
        notices=[e["text"] for e in notes.all("limitation")],
    )
