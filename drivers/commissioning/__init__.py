"""Commissioning: nodes, axes, objects and frames on the bus, conformance of a drive, bus load."""

from drivers.commissioning.bus_budget import BusBudget as BusBudget
from drivers.commissioning.bus_budget import stage_budget as stage_budget
from drivers.commissioning.frames import Decoded as Decoded
from drivers.commissioning.frames import FrameDecoder as FrameDecoder
from drivers.commissioning.object_values import meaning as meaning
from drivers.commissioning.object_values import parse as parse
from drivers.commissioning.object_values import raw_text as raw_text
from drivers.commissioning.object_values import reference as reference
from drivers.commissioning.object_values import type_name as type_name
from drivers.commissioning.object_values import unit_of as unit_of
from drivers.commissioning.scan import Found as Found
from drivers.commissioning.scan import scan as scan
from drivers.commissioning.status import AxisStatus as AxisStatus
from drivers.commissioning.status import error_line as error_line
from drivers.commissioning.status import status_of as status_of
