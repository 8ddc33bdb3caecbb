"""One CiA 402 drive: configuration, units, parameters, controlword and statusword.

A drive of another maker needs no code here: its EDS or DCF goes into the machine file (`eds`), and
`stagectl check` (`drivers.commissioning`) says what it lacks. What differs from drive to drive is
in `parameters`, `units` and `host_loss`.
"""

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
from drivers.drive.scaling import Scale, counts, dimension, unit
from drivers.drive.units import check_units

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
    "check_units",
    "counts",
    "decode",
    "dimension",
    "next_command",
    "next_controlword",
    "unit",
]
