"""Machine files: what one holds (`model`, with `drive` and `plant`), read by `file`.

`checks` and `plausible` refuse what cannot be. `unknown` is what a file leaves open for a diagnosis
to find; `twin` adds what one has found.
"""

from stagectl.config.machine.drive import NO_BUS as NO_BUS
from stagectl.config.machine.drive import Drive as Drive
from stagectl.config.machine.drive import Quirks as Quirks
from stagectl.config.machine.drive import position_unit_for as position_unit_for
from stagectl.config.machine.model import Axis as Axis
from stagectl.config.machine.model import AxisName as AxisName
from stagectl.config.machine.model import Effect as Effect
from stagectl.config.machine.model import Homing as Homing
from stagectl.config.machine.model import Label as Label
from stagectl.config.machine.model import LengthPair as LengthPair
from stagectl.config.machine.model import Machine as Machine
from stagectl.config.machine.model import Name as Name
