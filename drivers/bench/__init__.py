"""For whoever connects a stage: who is on the bus, what the axes do, how a drive behaves."""

from drivers.bench.bus_budget import BusBudget, stage_budget
from drivers.bench.scan import Found, scan
from drivers.bench.status import AxisStatus, error_line, status_of

__all__ = [
    "AxisStatus",
    "BusBudget",
    "Found",
    "error_line",
    "scan",
    "stage_budget",
    "status_of",
]
