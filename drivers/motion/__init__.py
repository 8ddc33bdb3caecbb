"""Motion: one module per mode of operation, setpoint limits, safe stop, fault reports."""

from drivers.motion.cyclic_modes import CyclicModes as CyclicModes
from drivers.motion.fault_report import command_text as command_text
from drivers.motion.homing import Homing as Homing
from drivers.motion.power import Power as Power
from drivers.motion.pp import ProfilePosition as ProfilePosition
from drivers.motion.profile_moves import ProfileMoves as ProfileMoves
from drivers.motion.safe_stop import SafeStop as SafeStop
