"""What runs, calibrations, maps and diagnoses say, on a terminal and on pages.

An `Outline` is built once and rendered twice: by `terminal`, and by `render` with a template, as
one self-contained HTML file, readable offline. Those of calibrations and maps are in their rooms,
of diagnoses in `gap`, which takes all of `sim2real`: nothing here imports it.
"""

from stagectl.report.ending import resume_command, verdict
from stagectl.report.outline import Cell, Fact, Outline, Section, Table
from stagectl.report.render import render_page, render_template
from stagectl.report.run_comparison import compare_runs
from stagectl.report.run_outline import friction_map_used, run_outline
from stagectl.report.run_page import write_report
from stagectl.report.svg import Line, Panel, Span, draw
from stagectl.report.terminal import Whole, print_outline, print_sections, print_table, whole

__all__ = [
    "Cell",
    "Fact",
    "Line",
    "Outline",
    "Panel",
    "Section",
    "Span",
    "Table",
    "Whole",
    "compare_runs",
    "draw",
    "friction_map_used",
    "print_outline",
    "print_sections",
    "print_table",
    "render_page",
    "render_template",
    "resume_command",
    "run_outline",
    "verdict",
    "whole",
    "write_report",
]
