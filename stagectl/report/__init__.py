"""HTML pages on runs and gap diagnoses: one self-contained file each, readable offline.

The pages of friction maps and calibrations, in rooms above, are rendered with the same parts.
`write_gap_page` is imported when it is first used: it takes all of `sim2real`, which a run does not
need.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from stagectl.report.content import friction_map_used
from stagectl.report.ending import interruption, resume_command, verdict
from stagectl.report.page import write_report
from stagectl.report.render import render_template
from stagectl.report.svg import Line, Panel, Span, draw, ticks

if TYPE_CHECKING:
    from stagectl.report.gap import write_gap_page

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


def __getattr__(name: str) -> Any:
    if name != "write_gap_page":
        raise AttributeError(f"module 'stagectl.report' has no attribute {name!r}")
    from stagectl.report.gap import write_gap_page

    return write_gap_page
