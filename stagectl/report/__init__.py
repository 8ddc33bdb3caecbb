"""HTML pages on runs and gap diagnoses: one self-contained file each, readable offline.

The pages of friction maps and calibrations, in rooms above, are rendered with the same parts.
"""

from stagectl.report.content import friction_map_used
from stagectl.report.ending import interruption, resume_command, verdict
from stagectl.report.gap_page import write_gap_page
from stagectl.report.page import write_report
from stagectl.report.render import render_template
from stagectl.report.svg import Line, Panel, Span, draw, ticks

__all__ = [
    "Line",
    "Panel",
    "Span",
    "draw",
    "friction_map_used",
    "interruption",
    "render_template",
    "resume_command",
    "ticks",
    "verdict",
    "write_gap_page",
    "write_report",
]
