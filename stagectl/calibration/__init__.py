"""Friction measured at fixed sites: which sites are due, what is done there, what came of it."""

from stagectl.calibration.due import due_now, due_sites
from stagectl.calibration.identify import identify_axis, identify_pieces
from stagectl.calibration.interrupted import load_interrupted_calibration
from stagectl.calibration.outcome import (
    SiteOutcome,
    outcomes,
    overall,
    predicted_line,
    reached_lines,
    visited,
)
from stagectl.calibration.sequence import SiteSequence
from stagectl.calibration.sites import Calibration, DueSection, load_calibration
from stagectl.calibration.slip_in import slip_in

__all__ = [
    "Calibration",
    "DueSection",
    "SiteOutcome",
    "SiteSequence",
    "due_now",
    "due_sites",
    "identify_axis",
    "identify_pieces",
    "load_calibration",
    "load_interrupted_calibration",
    "outcomes",
    "overall",
    "predicted_line",
    "reached_lines",
    "slip_in",
    "visited",
]
