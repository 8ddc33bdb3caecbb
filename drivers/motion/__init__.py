"""Motion: power states, homing, setpoint limits, safe stop, fault reports, moves in pp."""

from drivers.motion.fault_report import command_text as command_text
from drivers.motion.homing import home as home
from drivers.motion.limits import Setpoint as Setpoint
from drivers.motion.limits import check_profile as check_profile
from drivers.motion.limits import checked_forces as checked_forces
from drivers.motion.limits import checked_positions as checked_positions
from drivers.motion.limits import checked_profile as checked_profile
from drivers.motion.limits import checked_velocities as checked_velocities
from drivers.motion.power import HOLDING_TIMEOUT as HOLDING_TIMEOUT
from drivers.motion.power import Power as Power
from drivers.motion.profile_moves import ProfileMoves as ProfileMoves
from drivers.motion.safe_stop import SafeStop as SafeStop
from drivers.motion.standstill import wait_for_rest as wait_for_rest
from drivers.motion.travel_guard import TravelGuard as TravelGuard
