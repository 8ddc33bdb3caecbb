"""HTML pages on runs and gap diagnoses: one self-contained file each, readable offline."""

from stagectl.report.ending import interruption, resume_command, verdict
from stagectl.report.gap_page import write_gap_page
from stagectl.report.page import write_report
from stagectl.report.svg import Line, Panel, Span, draw, ticks

__all__ = [
    "Line",
    "Panel",
    "Span",
    "draw",
    "interruption",
    "resume_command",
    "ticks",
    "verdict",
    "write_gap_page",
    "write_report",
]
