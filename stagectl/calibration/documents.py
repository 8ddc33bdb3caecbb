"""Summary and page of a calibration, made again from its recording.

The recording does not hold the map that was built at its end: the sites' levels are those of the
estimates, and nothing is compared with the map before.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

from stagectl.calibration.outcome import site_outcomes, visited_sites
from stagectl.calibration.page import CalibrationReport, write_calibration_page
from stagectl.calibration.recorded import read_calibration
from stagectl.calibration.sites import recorded_sequence
from stagectl.config.machine.file import parse_machine
from stagectl.history import StageKey
from stagectl.report import friction_map_used
from stagectl.run import document_paths, is_calibration, rewrite_documents
from stagectl.store import read_notes, recording_in


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
        notices=[e["text"] for e in notes.events if e["event"] == "limitation"],
    )
