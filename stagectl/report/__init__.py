"""What runs, calibrations, maps and diagnoses say, on a terminal and on pages.

An `Outline` is built once and rendered twice: by `terminal`, and by `render` with a template, as
one self-contained HTML file, readable offline. Those of calibrations and maps are in their rooms,
of diagnoses in `gap`, which takes all of `sim2real`: nothing here imports it.
"""

from stagectl.report.ending import resume_command as resume_command
from stagectl.report.ending import verdict as verdict
from stagectl.report.outline import Cell as Cell
from stagectl.report.outline import Fact as Fact
from stagectl.report.outline import Outline as Outline
from stagectl.report.outline import Section as Section
from stagectl.report.outline import Table as Table
from stagectl.report.render import render_page as render_page
from stagectl.report.render import render_template as render_template
from stagectl.report.run_outline import friction_map_used as friction_map_used
from stagectl.report.run_outline import run_outline as run_outline
from stagectl.report.run_page import render_report as render_report
from stagectl.report.svg import Line as Line
from stagectl.report.svg import Panel as Panel
from stagectl.report.svg import Span as Span
from stagectl.report.svg import draw as draw
from stagectl.report.terminal import Whole as Whole
from stagectl.report.terminal import print_outline as print_outline
from stagectl.report.terminal import print_sections as print_sections
from stagectl.report.terminal import print_table as print_table
from stagectl.report.terminal import whole as whole
