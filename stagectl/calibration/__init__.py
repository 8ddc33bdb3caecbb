"""Calibration: friction measured at fixed sites, and identified from recordings.

`sites` (the file), `sequence` (moves at a site), `due` (when), `slip_in` (into production),
`outcome` and `report` (results), `interrupted` (to be resumed), `identify` (figures of an axis).
"""

from stagectl.calibration.due_sites import due_now, due_sites
from stagectl.calibration.identify import identify_axis, identify_pieces
from stagectl.calibration.insert_sites import slip_in_sites
from stagectl.calibration.interrupted import load_interrupted_calibration
from stagectl.calibration.outcome import (
    SiteOutcome,
    common_changes,
    predicted_gains,
    reached_gains,
    site_outcomes,
    visited_sites,
)
from stagectl.calibration.report import CalibrationReport, write_calibration_report
from stagectl.calibration.sequence import SiteSequence
from stagectl.calibration.sites import Calibration, DueSection, load_calibration

__all__ = [
    "Calibration",
    "CalibrationReport",
    "DueSection",
    "SiteOutcome",
    "SiteSequence",
    "common_changes",
    "due_now",
    "due_sites",
    "identify_axis",
    "identify_pieces",
    "load_calibration",
    "load_interrupted_calibration",
    "predicted_gains",
    "reached_gains",
    "site_outcomes",
    "slip_in_sites",
    "visited_sites",
    "write_calibration_report",
]
