"""Names, numbers and quantities of the CANopen objects in use (CiA 301, CiA 402-2).

Data types, access and presence are taken from the EDS. How large one unit of a quantity is differs
from axis to axis: `drivers.drive.scaling`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto


class Quantity(Enum):
    """What an object's integer counts."""

    POSITION = auto()
    VELOCITY = auto()
    ACCELERATION = auto()
    FORCE = auto()
    MILLISECONDS = auto()
    MICROSECONDS = auto()
    CODE = auto()
    """A word, a selection, a number of something: no unit."""


@dataclass(frozen=True, slots=True)
class ObjectRef:
    """One object dictionary entry.

    Attributes:
        index: 0x0000..0xFFFF.  sub: sub-index 0..255.  name: as in CiA 301 and 402.
        quantity: what it counts; of every object that the host writes.
    """

    index: int
    sub: int
    name: str
    quantity: Quantity | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.sub:02X} {self.name}".rstrip()


SYNC_ID = 0x080
"""CAN-ID of the SYNC object."""

# CiA 301: communication profile
DEVICE_TYPE = ObjectRef(0x1000, 0, "device type")
ERROR_REGISTER = ObjectRef(0x1001, 0, "error register")
ERROR_COUNT = ObjectRef(0x1003, 0, "number of errors")
SYNC_COB_ID = ObjectRef(0x1005, 0, "COB-ID SYNC", Quantity.CODE)
CYCLE_PERIOD = ObjectRef(0x1006, 0, "communication cycle period", Quantity.MICROSECONDS)
SYNC_WINDOW = ObjectRef(0x1007, 0, "synchronous window length", Quantity.MICROSECONDS)
HEARTBEAT_CONSUMER = ObjectRef(0x1016, 1, "consumer heartbeat time", Quantity.CODE)
HEARTBEAT_PRODUCER = ObjectRef(0x1017, 0, "producer heartbeat time", Quantity.MILLISECONDS)
VENDOR_ID = ObjectRef(0x1018, 1, "vendor id")
PRODUCT_CODE = ObjectRef(0x1018, 2, "product code")
REVISION = ObjectRef(0x1018, 3, "revision number")
SYNC_OVERFLOW = ObjectRef(0x1019, 0, "synchronous counter overflow value", Quantity.CODE)

# CiA 402: device control
ABORT_CONNECTION_OPTION = ObjectRef(0x6007, 0, "abort connection option code", Quantity.CODE)
ERROR_CODE = ObjectRef(0x603F, 0, "error code")
CONTROLWORD = ObjectRef(0x6040, 0, "controlword", Quantity.CODE)
STATUSWORD = ObjectRef(0x6041, 0, "statusword")
QUICK_STOP_OPTION = ObjectRef(0x605A, 0, "quick stop option code", Quantity.CODE)
SHUTDOWN_OPTION = ObjectRef(0x605B, 0, "shutdown option code", Quantity.CODE)
DISABLE_OPTION = ObjectRef(0x605C, 0, "disable operation option code", Quantity.CODE)
HALT_OPTION = ObjectRef(0x605D, 0, "halt option code", Quantity.CODE)
FAULT_REACTION_OPTION = ObjectRef(0x605E, 0, "fault reaction option code", Quantity.CODE)
MODE = ObjectRef(0x6060, 0, "modes of operation", Quantity.CODE)
MODE_DISPLAY = ObjectRef(0x6061, 0, "modes of operation display")
SUPPORTED_MODES = ObjectRef(0x6502, 0, "supported drive modes")

# CiA 402: position, force
POSITION_ACTUAL = ObjectRef(0x6064, 0, "position actual value", Quantity.POSITION)
FOLLOWING_ERROR_WINDOW = ObjectRef(0x6065, 0, "following error window", Quantity.POSITION)
FOLLOWING_ERROR_TIMEOUT = ObjectRef(0x6066, 0, "following error timeout", Quantity.MILLISECONDS)
POSITION_WINDOW = ObjectRef(0x6067, 0, "position window", Quantity.POSITION)
POSITION_WINDOW_TIME = ObjectRef(0x6068, 0, "position window time", Quantity.MILLISECONDS)
TARGET_FORCE = ObjectRef(0x6071, 0, "target torque", Quantity.FORCE)
MAX_FORCE = ObjectRef(0x6072, 0, "max torque", Quantity.FORCE)
RATED_FORCE = ObjectRef(0x6076, 0, "motor rated torque")
FORCE_ACTUAL = ObjectRef(0x6077, 0, "torque actual value", Quantity.FORCE)
TARGET_POSITION = ObjectRef(0x607A, 0, "target position", Quantity.POSITION)
POLARITY = ObjectRef(0x607E, 0, "polarity")
HOME_OFFSET = ObjectRef(0x607C, 0, "home offset", Quantity.POSITION)
SOFT_LIMIT_LOW = ObjectRef(0x607D, 1, "min position limit", Quantity.POSITION)
SOFT_LIMIT_HIGH = ObjectRef(0x607D, 2, "max position limit", Quantity.POSITION)
PROFILE_VELOCITY = ObjectRef(0x6081, 0, "profile velocity", Quantity.VELOCITY)
PROFILE_ACCELERATION = ObjectRef(0x6083, 0, "profile acceleration", Quantity.ACCELERATION)
PROFILE_DECELERATION = ObjectRef(0x6084, 0, "profile deceleration", Quantity.ACCELERATION)
QUICK_STOP_DECELERATION = ObjectRef(0x6085, 0, "quick stop deceleration", Quantity.ACCELERATION)
ENCODER_INCREMENTS = ObjectRef(0x608F, 1, "encoder increments")
ENCODER_REVOLUTIONS = ObjectRef(0x608F, 2, "motor revolutions")
GEAR_MOTOR = ObjectRef(0x6091, 1, "motor shaft revolutions")
GEAR_SHAFT = ObjectRef(0x6091, 2, "driving shaft revolutions")
FEED = ObjectRef(0x6092, 1, "feed")
FEED_REVOLUTIONS = ObjectRef(0x6092, 2, "feed shaft revolutions")
TARGET_VELOCITY = ObjectRef(0x60FF, 0, "target velocity", Quantity.VELOCITY)
VELOCITY_FACTOR = ObjectRef(0x6096, 1, "velocity factor")
VELOCITY_DIVISOR = ObjectRef(0x6096, 2, "velocity factor, divisor")
ACCELERATION_FACTOR = ObjectRef(0x6097, 1, "acceleration factor")
ACCELERATION_DIVISOR = ObjectRef(0x6097, 2, "acceleration factor, divisor")
POSITION_UNIT = ObjectRef(0x60A8, 0, "SI unit position")
VELOCITY_UNIT = ObjectRef(0x60A9, 0, "SI unit velocity")
ACCELERATION_UNIT = ObjectRef(0x60AA, 0, "SI unit acceleration")
POSITIONING_OPTION = ObjectRef(0x60F2, 0, "positioning option code")
VELOCITY_ACTUAL = ObjectRef(0x606C, 0, "velocity actual value", Quantity.VELOCITY)
DIGITAL_INPUTS = ObjectRef(0x60FD, 0, "digital inputs")
INTERLOCK = 1 << 3  # bit of 0x60FD: STO active, or enable input open
DIGITAL_OUTPUTS = ObjectRef(0x60FE, 1, "physical outputs")
FORCE_OFFSET = ObjectRef(0x60B2, 0, "torque offset", Quantity.FORCE)
INTERPOLATION_VALUE = ObjectRef(0x60C2, 1, "interpolation time period value", Quantity.CODE)
INTERPOLATION_INDEX = ObjectRef(0x60C2, 2, "interpolation time index", Quantity.CODE)

# CiA 402: homing
HOMING_METHOD = ObjectRef(0x6098, 0, "homing method", Quantity.CODE)
HOMING_SEARCH_SPEED = ObjectRef(0x6099, 1, "speed during search for switch", Quantity.VELOCITY)
HOMING_INDEX_SPEED = ObjectRef(0x6099, 2, "speed during search for zero", Quantity.VELOCITY)
HOMING_ACCELERATION = ObjectRef(0x609A, 0, "homing acceleration", Quantity.ACCELERATION)
