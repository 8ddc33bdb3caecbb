"""Keys of the device-profile objects (CiA 402) in the process image, and the axis' own values.

Forces take the place of torques: 1/1000 of the rated force, 0x6076 in mN. Positions are in nm,
velocities in nm/s, accelerations in um/s^2, jerk in um/s^3.
"""

from __future__ import annotations

from hil_sim.dictionary import Value, key
from hil_sim.settings import AxisSettings

CYCLE_PERIOD = key(0x1006)
SYNC_COB_ID = key(0x1005)
SYNC_OVERFLOW = key(0x1019)
ERROR_BEHAVIOR = key(0x1029, 1)
INDEX_SEARCH_RANGE = key(0x2004, 1)
ABORT_CONNECTION = key(0x6007)
CONTROLWORD = key(0x6040)
STATUSWORD = key(0x6041)
QUICK_STOP_OPTION = key(0x605A)
SHUTDOWN_OPTION = key(0x605B)
DISABLE_OPTION = key(0x605C)
HALT_OPTION = key(0x605D)
FAULT_OPTION = key(0x605E)
MODE = key(0x6060)
MODE_DISPLAY = key(0x6061)
POSITION_DEMAND = key(0x6062)
POSITION_INTERNAL = key(0x6063)
POSITION_ACTUAL = key(0x6064)
FOLLOWING_WINDOW = key(0x6065)
FOLLOWING_TIMEOUT = key(0x6066)
POSITION_WINDOW = key(0x6067)
POSITION_WINDOW_TIME = key(0x6068)
VELOCITY_ACTUAL = key(0x606C)
VELOCITY_WINDOW = key(0x606D)
VELOCITY_WINDOW_TIME = key(0x606E)
VELOCITY_THRESHOLD = key(0x606F)
TARGET_TORQUE = key(0x6071)
MAX_TORQUE = key(0x6072)
TORQUE_DEMAND = key(0x6074)
TORQUE_ACTUAL = key(0x6077)
TARGET_POSITION = key(0x607A)
HOME_OFFSET = key(0x607C)
SOFT_LIMIT_LOW = key(0x607D, 1)
SOFT_LIMIT_HIGH = key(0x607D, 2)
PROFILE_VELOCITY = key(0x6081)
PROFILE_ACCELERATION = key(0x6083)
PROFILE_DECELERATION = key(0x6084)
QUICK_STOP_DECELERATION = key(0x6085)
PROFILE_TYPE = key(0x6086)
HOMING_METHOD = key(0x6098)
HOMING_SPEED_SEARCH = key(0x6099, 1)
HOMING_SPEED_INDEX = key(0x6099, 2)
HOMING_ACCELERATION = key(0x609A)
PROFILE_JERK = key(0x60A4, 1)
TORQUE_OFFSET = key(0x60B2)
INTERPOLATION_VALUE = key(0x60C2, 1)
INTERPOLATION_INDEX = key(0x60C2, 2)
FOLLOWING_ERROR = key(0x60F4)
DIGITAL_INPUTS = key(0x60FD)
TARGET_VELOCITY = key(0x60FF)

OFF = 0xFFFFFFFF  # in 0x6065 and 0x6067: not watched

_MAGNET_PITCH = 0.032  # [m], stands for the motor revolution in the factor group


def axis_parameters(axis: AxisSettings) -> dict[int, Value]:
    """What this unit's objects hold after power-on in place of the EDS' examples."""
    control = axis.control
    peak = round(1000 * control.peak_force / control.rated_force)
    low, high = (round(limit * 1e9) for limit in axis.travel)
    return {
        key(0x1018, 4): axis.node,
        key(0x2000, 1): control.kp,
        key(0x2000, 2): control.ki,
        key(0x2000, 3): control.kd,
        key(0x2000, 4): control.derivative_time,
        key(0x2000, 5): control.period,
        key(0x2001, 1): control.current_bandwidth,
        key(0x2001, 2): control.peak_force,
        key(0x2002, 1): axis.increment,
        key(0x2003, 1): axis.velocity,
        key(0x2003, 2): axis.acceleration,
        key(0x2003, 3): axis.jerk,
        key(0x6072): peak,
        key(0x6073): peak,
        key(0x6076): round(control.rated_force * 1e3),
        key(0x608F, 1): round(_MAGNET_PITCH / axis.increment),
        key(0x6092, 1): round(_MAGNET_PITCH * 1e9),
        FOLLOWING_WINDOW: round(axis.following_error * 1e9),
        SOFT_LIMIT_LOW: low,
        SOFT_LIMIT_HIGH: high,
        PROFILE_ACCELERATION: round(axis.acceleration * 1e6 / 10),
        PROFILE_DECELERATION: round(axis.acceleration * 1e6 / 10),
        QUICK_STOP_DECELERATION: round(axis.acceleration * 1e6),
        PROFILE_JERK: min(round(axis.jerk * 1e6), 0xFFFFFFFF),
    }
