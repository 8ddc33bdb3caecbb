"""HTML pages on runs and gap diagnoses: one self-contained file each, readable offline.

The pages of friction maps and calibrations, in rooms above, are rendered with the same parts.
Those of diagnoses are in `gap`, which takes all of `sim2real`: nothing here imports it.
"""

from stagectl.report.ending import interruption, resume_command, verdict
from stagectl.report.facts import friction_map_used
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
    "write_report",
]
