"""CANopen on the host's side: bus, nodes, SDO, PDO mappings, EMCY, detection of other hosts."""

from drivers.canopen.bus import Network, OwnFrame, Tap, open_bus
from drivers.canopen.clock import Clock, MonotonicClock, delivers_at_once, stamps_of
from drivers.canopen.emcy import error_text, register_text
from drivers.canopen.nmt import NMT_COMMANDS, NMT_STATES
from drivers.canopen.node import REBOOTED, Node
from drivers.canopen.other_host import LISTENING
from drivers.canopen.pdo import MappedObject, PdoMapping, PdoRecord
from drivers.canopen.remote_objects import RemoteObjects, Value, load_dictionary
from drivers.canopen.sdo_channel import SdoChannel

__all__ = [
    "LISTENING",
    "NMT_COMMANDS",
    "NMT_STATES",
    "REBOOTED",
    "Clock",
    "MappedObject",
    "MonotonicClock",
    "Network",
    "Node",
    "OwnFrame",
    "PdoMapping",
    "PdoRecord",
    "RemoteObjects",
    "SdoChannel",
    "Tap",
    "Value",
    "delivers_at_once",
    "error_text",
    "load_dictionary",
    "open_bus",
    "register_text",
    "stamps_of",
]
