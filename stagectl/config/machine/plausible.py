"""Plausible machine parameters: each within a range, and together a machine that can move.

The ranges are wide, some decades beyond any stage ever built: mistaken units are found by their
dimension, and the ranges of a drive's integers are in `stagectl.config.machine.checks`. Together,
the drive must have the force to move and to stop the axis, and each length must be within the next
larger one, so that no threshold is always or never exceeded.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stagectl.config.machine.model import Axis

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


def find_contradictions(axis: Axis) -> Iterator[tuple[tuple[str, ...], str]]:
    """Keys within the axis of values that contradict others, and why."""
    yield from _lacking_force(axis)
    yield from _disordered_lengths(axis)


def _lacking_force(axis: Axis) -> Iterator[tuple[tuple[str, ...], str]]:
    """The drive must have the force to move the axis, and to stop it within its travel."""
    limits, plant, friction = axis.limits, axis.plant, axis.plant.friction
    peak, span = axis.drive.peak_force, axis.travel[1] - axis.travel[0]
    has = f"the drive has {peak:g} N at most (drive.peak_force)"
    breakaway = friction.coulomb * (1.0 + max(friction.static_ratio, 0.0))
    drag = friction.viscous * limits.velocity
    stop = plant.mass * limits.velocity**2 / (2.0 * peak)
    if breakaway >= peak:
        yield ("plant", "friction", "coulomb"), f"breakaway takes {breakaway:.4g} N; {has}"
    if drag >= peak:
        reason = f"at limits.velocity, {limits.velocity:g} m/s, it is {drag:.4g} N; {has}"
        yield ("plant", "friction", "viscous"), reason
    if stop > span > 0.0:
        reason = f"{plant.mass:g} kg at {limits.velocity:g} m/s need {stop:.3g} m to stop"
        yield ("plant", "mass"), f"{reason}, the travel is {span:g} m; {has}"


def _disordered_lengths(axis: Axis) -> Iterator[tuple[tuple[str, ...], str]]:
    """Resolution and target window are within the following error, and that within the travel."""
    span, limit = axis.travel[1] - axis.travel[0], axis.limits.following_error
    if span > 0.0 and limit >= span:
        reason = f"{limit:g} m is never exceeded within the travel of {span:g} m"
        yield ("limits", "following_error"), reason
    error = f"limits.following_error, {limit:g} m"
    for key, length in (
        (("encoder", "increment"), axis.encoder.increment),
        (("encoder", "noise"), axis.encoder.noise),
        (("limits", "position_window"), axis.limits.position_window),
    ):
        if length >= limit:
            yield key, f"{length:g} m must be below {error}"
    friction = axis.plant.friction
    if friction.stiffness is not None and friction.coulomb / friction.stiffness >= span > 0.0:
        presliding = friction.coulomb / friction.stiffness
        reason = f"presliding over {presliding:.4g} m (coulomb / stiffness) exceeds the travel"
        yield ("plant", "friction", "stiffness"), reason


def _value(node: object, path: tuple[str, ...]) -> float | None:
    """The value at a path; None if the file has none."""
    for name in path:
        node = None if node is None else getattr(node, name)
    assert node is None or isinstance(node, float)  # noqa: S101 - all keys above are of numbers
    return node
