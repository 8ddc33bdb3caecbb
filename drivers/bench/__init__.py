"""Commissioning: nodes, axes, objects and frames on the bus, conformance of a drive, bus load."""

from drivers.bench.bus_budget import BusBudget, stage_budget
from drivers.bench.frames import Decoded, FrameDecoder
from drivers.bench.object_values import meaning, parse, raw_text, reference, type_name, unit_of
from drivers.bench.scan import Found, scan
from drivers.bench.status import AxisStatus, error_line, status_of

__all__ = [
    "AxisStatus",
    "BusBudget",
    "Decoded",
    "Found",
    "FrameDecoder",
    "error_line",
    "meaning",
    "parse",
    "raw_text",
    "reference",
    "scan",
    "stage_budget",
    "status_of",
    "type_name",
    "unit_of",
]
