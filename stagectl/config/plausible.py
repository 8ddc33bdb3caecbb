"""Plausible ranges of machine parameters: beyond them, physics or arithmetic fails.

The ranges are wide, some decades beyond any stage ever built: mistaken units are found by their
dimension, and the ranges of a drive's integers are in `stagectl.config.machine_checks`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stagectl.config.machine import Axis

RANGES: dict[str, tuple[float, float, str]] = {
    "limits.jerk": (1e-9, 1e15, "m/s^3"),
    "encoder.increment": (1e-15, 1.0, "m"),
    "encoder.noise": (0.0, 1.0, "m"),
    "drive.rated_force": (1e-9, 1e9, "N"),
    "drive.current_bandwidth": (1e-3, 1e9, "Hz"),
    "drive.control_period": (1e-6, 1.0, "s"),
    "drive.position_unit": (1e-15, 1.0, "m"),
    "drive.velocity_unit": (1e-15, 1e3, "m/s"),
    "drive.acceleration_unit": (1e-15, 1e6, "m/s^2"),
    "drive.boot_timeout": (1e-3, 600.0, "s"),
    "drive.enable_timeout": (1e-3, 600.0, "s"),
    "drive.pid.kp": (1e-9, 1e15, "N/m"),
    "drive.pid.ki": (0.0, 1e18, "N/(m s)"),
    "drive.pid.kd": (0.0, 1e12, "N s/m"),
    "drive.pid.derivative_time": (0.0, 1e3, "s"),
    "drive.cascade.position_gain": (1e-9, 1e9, "1/s"),
    "drive.cascade.velocity_gain": (1e-9, 1e12, "N s/m"),
    "drive.cascade.velocity_integral": (0.0, 1e15, "N/m"),
    "drive.cascade.derivative_time": (0.0, 1e3, "s"),
    "plant.mass": (1e-9, 1e9, "kg"),
    "plant.friction.coulomb": (1e-12, 1e9, "N"),
    "plant.friction.static_ratio": (-1.0, 1e3, ""),
    "plant.friction.stribeck_velocity": (1e-12, 1e6, "m/s"),
    "plant.friction.stribeck_shape": (1e-3, 1e3, ""),
    "plant.friction.stiffness": (1e-9, 1e15, "N/m"),
    "plant.friction.attraction": (1e-12, 1e15, "N/s"),
    "plant.friction.viscous": (0.0, 1e12, "N s/m"),
    "plant.friction.repeatability.coulomb": (0.0, 1.0, ""),
    "plant.friction.repeatability.correlation_time": (1e-9, 1e12, "s"),
    "homing.velocity": (1e-15, 1e6, "m/s"),
    "homing.index_velocity": (1e-15, 1e6, "m/s"),
}
"""Key within the axis -> lowest and highest value, unit."""


def find_implausible(axis: Axis) -> Iterator[tuple[tuple[str, ...], str]]:
    """Keys within the axis of implausible values, and what they must be."""
    for key, (least, greatest, unit) in RANGES.items():
        path = tuple(key.split("."))
        value = _value(axis, path)
        if value is not None and value < least:
            yield path, f"must be at least {least:g} {unit}, is {value:g}"
        elif value is not None and value > greatest:
            yield path, f"must be at most {greatest:g}{f' {unit}' if unit else ''}, is {value:g}"


def _value(node: object, path: tuple[str, ...]) -> float | None:
    """The value at a path; None if the file has none."""
    for name in path:
        node = None if node is None else getattr(node, name)
    assert node is None or isinstance(node, float)  # noqa: S101 - all keys above are of numbers
    return node
