"""Calibration: friction measured at fixed sites, and identified from recordings.

`sites` (the file), `enough_sites` (for a map), `sequence` (moves at a site), `due` (when),
`insert_sites` (into production), `execution` (the whole of it), `outcome` and `page` (results),
`recorded` (what a recording says), `documents` (results again from it), `identify` (figures of an
axis).
"""

from stagectl.calibration.documents import rewrite_all_documents
from stagectl.calibration.due_sites import due_now, due_sites
from stagectl.calibration.enough_sites import require_enough_sites
from stagectl.calibration.execution import calibrate, calibration_as_json, resume_calibration
from stagectl.calibration.identify import identify_axis, identify_pieces
from stagectl.calibration.insert_sites import insert_sites
from stagectl.calibration.outcome import (
    SiteOutcome,
    predicted_gains,
    site_outcomes,
    visited_sites,
)
from stagectl.calibration.page import (
    CalibrationReport,
    calibration_outline,
    write_calibration_page,
)
from stagectl.calibration.sequence import SiteSequence
from stagectl.calibration.sites import Calibration, DueSection, load_calibration

__all__ = [
    "Calibration",
    "CalibrationReport",
    "DueSection",
    "SiteOutcome",
    "SiteSequence",
    "calibrate",
    "calibration_as_json",
    "calibration_outline",
    "due_now",
    "due_sites",
    "identify_axis",
    "identify_pieces",
    "insert_sites",
    "load_calibration",
    "predicted_gains",
    "require_enough_sites",
    "resume_calibration",
    "rewrite_all_documents",
    "site_outcomes",
    "visited_sites",
    "write_calibration_page",
]
