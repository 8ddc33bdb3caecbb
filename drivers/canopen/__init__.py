"""CANopen on the host's side: bus, nodes, SDO, PDO mappings, EMCY, detection of other hosts."""

from drivers.canopen.bus import Network as Network
from drivers.canopen.bus import OwnFrame as OwnFrame
from drivers.canopen.bus import Tap as Tap
from drivers.canopen.bus import open_bus as open_bus
from drivers.canopen.clock import Clock as Clock
from drivers.canopen.clock import MonotonicClock as MonotonicClock
from drivers.canopen.clock import delivers_at_once as delivers_at_once
from drivers.canopen.clock import stamps_of as stamps_of
from drivers.canopen.emcy import error_text as error_text
from drivers.canopen.emcy import register_text as register_text
from drivers.canopen.nmt import NMT_COMMANDS as NMT_COMMANDS
from drivers.canopen.nmt import NMT_STATES as NMT_STATES
from drivers.canopen.node import REBOOTED as REBOOTED
from drivers.canopen.node import Node as Node
from drivers.canopen.other_host import LISTENING as LISTENING
from drivers.canopen.pdo import RPDO as RPDO
from drivers.canopen.pdo import TPDO as TPDO
from drivers.canopen.pdo import PdoMapping as PdoMapping
from drivers.canopen.pdo import configure_pdo as configure_pdo
from drivers.canopen.pdo import disable_pdo as disable_pdo
from drivers.canopen.pdo import pdo_label as pdo_label
from drivers.canopen.remote_objects import RemoteObjects as RemoteObjects
from drivers.canopen.remote_objects import Value as Value
from drivers.canopen.remote_objects import load_dictionary as load_dictionary
from drivers.canopen.sdo_channel import SdoChannel as SdoChannel
