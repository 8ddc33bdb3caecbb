"""Units of an axis that turns: rad for m, N m for N and kg m² for kg, in all that is reported."""

from __future__ import annotations

from hil_sim.settings import AxisSettings

_ANGULAR = {
    "m": "rad",
    "mm": "mrad",
    "µm": "µrad",
    "m/s": "rad/s",
    "m/s^2": "rad/s^2",
    "mm/s": "mrad/s",
    "1/m": "1/rad",
    "N": "N m",
    "kg": "kg m²",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "N/s": "N m/s",
    "metres": "radians",
    "newtons": "newton metres",
}


def unit_on(axis: AxisSettings, unit: str) -> str:
    """The unit on this axis of what has `unit` on an axis that slides."""
    return angular_unit(unit) if axis.rotary else unit


def angular_unit(unit: str) -> str:
    """The unit on an axis that turns; units without length, force or mass stay as they are."""
    return _ANGULAR.get(unit, unit)
