"""Commissioning: nodes, axes, objects and frames on the bus, conformance of a drive, bus load."""

from drivers.commissioning.bus_budget import BusBudget, stage_budget
from drivers.commissioning.frames import Decoded, FrameDecoder
from drivers.commissioning.object_values import (
    meaning,
    parse,
    raw_text,
    reference,
    type_name,
    unit_of,
)
from drivers.commissioning.scan import Found, scan
from drivers.commissioning.status import AxisStatus, error_line, status_of

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
