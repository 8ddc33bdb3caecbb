"""Self-contained HTML reports of runs: one file, no network, readable on a projector."""

from stagectl.report.gap_page import write_gap_page
from stagectl.report.page import write_report

__all__ = [
    "write_gap_page",
    "write_report",
]
