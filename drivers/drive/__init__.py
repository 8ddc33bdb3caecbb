"""One CiA 402 drive: configuration, units, parameters, controlword and statusword.

A drive of another maker needs no code here: its EDS or DCF goes into the machine file (`eds`), and
`stagectl check` (`drivers.commissioning`) says what it lacks. What differs from drive to drive is
in `parameters`, `units` and `host_loss`.
"""

from drivers.drive.axis import Axis as Axis
from drivers.drive.cia402 import ENABLED_MASK as ENABLED_MASK
from drivers.drive.cia402 import ENABLED_VALUE as ENABLED_VALUE
from drivers.drive.cia402 import MODE_NAMES as MODE_NAMES
from drivers.drive.cia402 import TRANSITIONS as TRANSITIONS
from drivers.drive.cia402 import Command as Command
from drivers.drive.cia402 import Control as Control
from drivers.drive.cia402 import Mode as Mode
from drivers.drive.cia402 import State as State
from drivers.drive.cia402 import Status as Status
from drivers.drive.cia402 import decode as decode
from drivers.drive.cia402 import next_command as next_command
from drivers.drive.cia402 import next_controlword as next_controlword
from drivers.drive.scaling import counts as counts
from drivers.drive.scaling import dimension as dimension
from drivers.drive.scaling import unit as unit
from drivers.drive.units import check_units as check_units
