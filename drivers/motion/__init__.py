"""Motion: one module per mode of operation, setpoint limits, safe stop, fault reports."""

from drivers.motion.csp import CyclicPosition
from drivers.motion.csv_cst import CyclicForce, CyclicVelocity
from drivers.motion.fault_report import command_text
from drivers.motion.homing import Homing
from drivers.motion.power import HOLDING_TIMEOUT, Power
from drivers.motion.pp import ProfilePosition
from drivers.motion.profile_moves import ProfileMoves
from drivers.motion.safe_stop import SafeStop
from drivers.motion.standstill import halt

__all__ = [
    "HOLDING_TIMEOUT",
    "CyclicForce",
    "CyclicPosition",
    "CyclicVelocity",
    "Homing",
    "Power",
    "ProfileMoves",
    "ProfilePosition",
    "SafeStop",
    "command_text",
    "halt",
]
