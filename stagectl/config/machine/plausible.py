"""Plausible machine parameters: each within a range, and together a machine that can move.

The ranges, in the annotations of the models, are wide, some decades beyond any stage ever built:
mistaken units are found by their dimension, and the ranges of a drive's integers are in
`stagectl.config.machine.checks`. Together, the drive must have the force to move and to stop the
axis, and each length must be within the next larger one, so that no threshold is always or never
exceeded.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from stagectl.config.parsing.validation import Section

if TYPE_CHECKING:
    from stagectl.config.machine.model import Axis

Place = tuple[str, ...]


class Plausible(NamedTuple):
    """The range of a parameter, in its annotation.

    Attributes:
        least, greatest: value.
        unit: of both; "" for a number.
    """

    least: float
    greatest: float
    unit: str = ""


def find_ranges(section: Section, at: Place = ()) -> Iterator[tuple[Place, float, Plausible]]:
    """The values within the section at `at` that have a range: key, value, range."""
    for name, field in type(section).model_fields.items():
        value, path = getattr(section, name), (*at, name)
        if isinstance(value, Section):
            yield from find_ranges(value, path)
        elif value is not None:
            yield from ((path, value, m) for m in field.metadata if isinstance(m, Plausible))


def find_implausible(axis: Axis) -> Iterator[tuple[Place, str]]:
    """Keys within the axis of implausible values, and what they must be."""
    for path, value, (least, greatest, unit) in find_ranges(axis):
        in_unit = f" {axis.unit_of(unit)}" if unit else ""
        if value < least:
            yield path, f"must be at least {least:g}{in_unit}, is {value:g}"
        elif value > greatest:
            yield path, f"must be at most {greatest:g}{in_unit}, is {value:g}"


def find_contradictions(axis: Axis, *, is_log: bool = False) -> Iterator[tuple[Place, str]]:
    """Keys within the axis of values that contradict others, and why.

    Args:
        axis: of a machine file.
        is_log: whether only a log says what its drive is: it has moved the axis.
    """
    if not is_log:
        yield from _lacking_force(axis)
    yield from _disordered_lengths(axis)


def _lacking_force(axis: Axis) -> Iterator[tuple[Place, str]]:
    """The drive must have the force to move the axis, and to stop it within its travel."""
    limits, plant, friction = axis.limits, axis.plant, axis.plant.friction
    newton, metre = axis.unit_of("N"), axis.unit_of("m")
    peak, span = axis.drive.peak_force, axis.travel[1] - axis.travel[0]
    has = f"the drive has {peak:g} {newton} at most (drive.peak_force)"
    breakaway = friction.coulomb * (1.0 + max(friction.static_ratio, 0.0))
    drag = friction.viscous * limits.velocity
    stop = plant.mass * limits.velocity**2 / (2.0 * peak)
    speed = f"{limits.velocity:g} {axis.unit_of('m/s')}"
    if breakaway >= peak:
        yield ("plant", "friction", "coulomb"), f"breakaway takes {breakaway:.4g} {newton}; {has}"
    if drag >= peak:
        reason = f"at limits.velocity, {speed}, it is {drag:.4g} {newton}; {has}"
        yield ("plant", "friction", "viscous"), reason
    if stop > span > 0.0:
        moving = f"{plant.mass:g} {axis.unit_of('kg')} at {speed} need {stop:.3g} {metre} to stop"
        yield ("plant", "mass"), f"{moving}, the travel is {span:g} {metre}; {has}"


def _disordered_lengths(axis: Axis) -> Iterator[tuple[Place, str]]:
    """Resolution and target window are within the following error, and that within the travel."""
    span, limit = axis.travel[1] - axis.travel[0], axis.limits.following_error
    metre = axis.unit_of("m")
    if span > 0.0 and limit >= span:
        reason = f"{limit:g} {metre} is never exceeded within the travel of {span:g} {metre}"
        yield ("limits", "following_error"), reason
    error = f"limits.following_error, {limit:g} {metre}"
    for key, length in (
        (("encoder", "increment"), axis.encoder.increment),
        (("encoder", "noise"), axis.encoder.noise),
        (("limits", "position_window"), axis.limits.position_window),
    ):
        if length >= limit:
            yield key, f"{length:g} {metre} must be below {error}"
    friction = axis.plant.friction
    if friction.stiffness is not None and friction.coulomb / friction.stiffness >= span > 0.0:
        presliding = friction.coulomb / friction.stiffness
        reason = (
            f"presliding over {presliding:.4g} {metre} (coulomb / stiffness) exceeds the travel"
        )
        yield ("plant", "friction", "stiffness"), reason
