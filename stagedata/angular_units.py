"""Units of an axis that turns: rad for m, N m for N and kg m² for kg, in all that is reported."""

from __future__ import annotations

_ANGULAR = {
    "m": "rad",
    "mm": "mrad",
    "µm": "µrad",
    "m/s": "rad/s",
    "mm/s": "mrad/s",
    "m/s^2": "rad/s^2",
    "m/s^3": "rad/s^3",
    "1/m": "1/rad",
    "N": "N m",
    "kg": "kg m²",
    "N/m": "N m/rad",
    "N s/m": "N m s/rad",
    "N/s": "N m/s",
    "N/(m s)": "N m/(rad s)",
    "metres": "radians",
    "newtons": "newton metres",
}


def angular_unit(unit: str) -> str:
    """The unit on an axis that turns; units without length, force or mass stay as they are."""
    return _ANGULAR.get(unit, unit)
