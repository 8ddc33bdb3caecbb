"""One CiA 402 drive: configuration, units, parameters, controlword and statusword."""

from drivers.drive.axis import Axis
from drivers.drive.cia402 import (
    ENABLED_MASK,
    ENABLED_VALUE,
    TRANSITIONS,
    Command,
    Control,
    Mode,
    State,
    Status,
    decode,
    next_command,
    next_controlword,
)
from drivers.drive.units import Scale

__all__ = [
    "ENABLED_MASK",
    "ENABLED_VALUE",
    "TRANSITIONS",
    "Axis",
    "Command",
    "Control",
    "Mode",
    "Scale",
    "State",
    "Status",
    "decode",
    "next_command",
    "next_controlword",
]
