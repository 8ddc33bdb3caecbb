"""Commissioning: nodes on the bus, status of the axes, conformance of a drive, bus load."""

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
