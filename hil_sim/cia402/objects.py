"""Keys of the device-profile objects (CiA 402) in the process image, and this axis' own values.

Forces take the place of torques: 1/1000 of the rated force, 0x6076 in mN. Positions, velocities and
accelerations are in the units of the axis' settings, by default nm, nm/s and um/s^2.
"""

from __future__ import annotations

import math

from hil_sim.cia301 import Value, key
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
OUTPUTS, OUTPUT_MASK = key(0x60FE, 1), key(0x60FE, 2)
TARGET_VELOCITY = key(0x60FF)

ACT_LAST = (MODE, CONTROLWORD)
"""Objects that act after all others of the same SYNC or frame, in this order: a mode finds its
parameters, a command the mode and the setpoints that came with it."""

OFF = 0xFFFFFFFF  # in 0x6065 and 0x6067: not supervised

_MAGNET_PITCH = 0.032  # [m], stands for the motor revolution in the factor group


def axis_parameters(axis: AxisSettings) -> dict[int, Value]:
    """Values that this axis' objects have after power-on in place of the EDS' examples, by key."""
    control = axis.control
    peak = round(1000 * control.peak_force / control.rated_force)
    low, high = (round(limit / axis.unit) for limit in axis.travel)
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
        key(0x6092, 1): round(_MAGNET_PITCH / axis.unit),
        FOLLOWING_WINDOW: round(axis.following_error / axis.unit),
        SOFT_LIMIT_LOW: low,
        SOFT_LIMIT_HIGH: high,
        POSITION_WINDOW: round(1e-6 / axis.unit),
        VELOCITY_WINDOW: round(50e-6 / axis.velocity_unit),
        VELOCITY_THRESHOLD: round(50e-6 / axis.velocity_unit),
        PROFILE_VELOCITY: round(0.1 / axis.velocity_unit),
        HOMING_SPEED_SEARCH: round(0.01 / axis.velocity_unit),
        HOMING_SPEED_INDEX: round(0.002 / axis.velocity_unit),
        HOMING_ACCELERATION: round(0.5 / axis.acceleration_unit),
        key(0x60A8): _notation(axis, axis.unit, 0x00),
        key(0x60A9): _notation(axis, axis.velocity_unit, 0x03),
        key(0x60AA): _notation(axis, axis.acceleration_unit, 0x57),
        PROFILE_ACCELERATION: round(axis.acceleration / axis.acceleration_unit / 10),
        PROFILE_DECELERATION: round(axis.acceleration / axis.acceleration_unit / 10),
        QUICK_STOP_DECELERATION: round(axis.acceleration / axis.acceleration_unit),
        PROFILE_JERK: min(round(axis.jerk / axis.acceleration_unit), 0xFFFFFFFF),
    }


def _notation(axis: AxisSettings, unit: float, per: int) -> int:
    """CiA 303-2: power of ten, metre or radian, and what it is divided by; 0 for other units.

    Args:
        axis: whose unit it is.
        unit: in SI units.
        per: notation of 1 (0x00), second (0x03) or second squared (0x57).
    """
    power = round(math.log10(unit))
    if not math.isclose(unit, 10.0**power, rel_tol=1e-9) or not -128 <= power <= 127:
        return 0
    return (power & 0xFF) << 24 | (0x10 if axis.rotary else 0x01) << 16 | per << 8
