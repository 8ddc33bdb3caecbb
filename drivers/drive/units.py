"""Units of a drive: its factor group and SI units, read and compared with the settings.

Position: 0x608F encoder increments per motor revolution, 0x6091 gear, 0x6092 feed; together they
say how many encoder increments one position unit is. Velocity and acceleration: 0x6096 and 0x6097,
increments per second (and second) for one unit, or 0x60A9 and 0x60AA, the unit as a power of ten of
m/s and m/s^2. Force: 0x6076, in mN or mNm by CiA 402, whose thousandth all force values are in.

A drive may lack all of it: then the settings are trusted, and that is said.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from drivers import objects as od
from drivers.canopen import Node
from drivers.errors import ConfigurationError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

TOLERANCE = 1e-6
"""Factor groups are fractions of 32-bit numbers: they may miss the length by so much, relative."""
_METRE, _SECOND, _SECOND_SQUARED = 0x01, 0x03, 0x57
"""Notations of CiA 303-2 in 0x60A9 and 0x60AA."""
_TURNED = 0xC0
"""Bits 7 (position) and 6 (velocity) of 0x607E."""


@dataclass(frozen=True, slots=True)
class Scale:
    """SI values of one unit of the CAN integers: `increment` [m], `force` [N] (rated / 1000)."""

    increment: float
    force: float


def check_units(node: Node, settings: AxisSettings) -> list[str]:
    """Compares what the drive says of its units with the settings.

    Returns:
        What it does not say, one clause each.

    Raises:
        ConfigurationError: it says something else, or nonsense; names the object and both values.
        NodeError: it does not answer.
    """
    without = _check_position(node, settings)
    _check_rate(node, settings, od.VELOCITY_FACTOR, od.VELOCITY_DIVISOR, od.VELOCITY_UNIT,
                _SECOND, settings.velocity_unit_si, "velocity", "m/s")  # fmt: skip
    _check_rate(node, settings, od.ACCELERATION_FACTOR, od.ACCELERATION_DIVISOR,
                od.ACCELERATION_UNIT, _SECOND_SQUARED, settings.acceleration_unit,
                "acceleration", "m/s^2")  # fmt: skip
    _check_polarity(node, settings)
    return without + _check_force(node, settings)


def _check_position(node: Node, settings: AxisSettings) -> list[str]:
    without, factor = [], Fraction(1)
    for numerator, denominator, power in (
        (od.ENCODER_INCREMENTS, od.ENCODER_REVOLUTIONS, 1),
        (od.GEAR_MOTOR, od.GEAR_SHAFT, 1),
        (od.FEED, od.FEED_REVOLUTIONS, -1),
    ):
        ratio = _ratio(node, settings, numerator, denominator)
        if ratio is None:
            without.append(
                f"{numerator} is not offered: one position unit is taken to be "
                f"{settings.increment:g} m"
            )
        else:
            factor *= ratio**power
    if without:
        return without
    unit = float(factor) * settings.encoder_increment
    if not math.isclose(unit, settings.increment, rel_tol=TOLERANCE):
        raise ConfigurationError(
            f"factor group: one position unit is {float(factor):.6g} encoder increments of "
            f"{settings.encoder_increment:.6g} m, which is {unit:.6g} m; the settings say "
            f"{settings.increment:.6g} m",
            axis=settings.name, obj=od.FEED,
        )  # fmt: skip
    return []


def _check_rate(
    node: Node, settings: AxisSettings, factor: ObjectRef, divisor: ObjectRef, si: ObjectRef,
    time_notation: int, expected: float, what: str, unit: str,
) -> None:  # fmt: skip
    ratio = _ratio(node, settings, factor, divisor)
    told, ref = None, factor
    if ratio is not None:
        told = float(ratio) * settings.encoder_increment
    elif node.has(si):
        notation, ref = node.read(si) & 0xFFFFFFFF, si
        if notation >> 16 & 0xFF == _METRE and notation >> 8 & 0xFF == time_notation:
            prefix = notation >> 24
            told = 10.0 ** (prefix - 256 if prefix > 127 else prefix)
    if told is not None and not math.isclose(told, expected, rel_tol=TOLERANCE):
        raise ConfigurationError(
            f"one {what} unit is {told:.6g} {unit}, the settings say {expected:.6g} {unit}",
            axis=settings.name, obj=ref,
        )  # fmt: skip


def _check_polarity(node: Node, settings: AxisSettings) -> None:
    """0x607E turns positions and velocities round, forces not: offsets would push the wrong way."""
    polarity = node.read(od.POLARITY) if node.has(od.POLARITY) else 0
    if polarity & _TURNED:
        raise ConfigurationError(
            f"0x{polarity & 0xFF:02X} turns positions or velocities round, and not the forces with "
            "them; set it to 0, and the direction where motor and encoder are set up",
            axis=settings.name, obj=od.POLARITY,
        )  # fmt: skip


def _check_force(node: Node, settings: AxisSettings) -> list[str]:
    if not node.has(od.RATED_FORCE):
        return [
            f"{od.RATED_FORCE} is not offered: the rated force is taken to be "
            f"{settings.rated_force:g} N"
        ]
    held, rated = node.read(od.RATED_FORCE), round(settings.rated_force * 1000)
    if held != rated:
        raise ConfigurationError(
            f"the drive says {held / 1000:g} N, the settings {rated / 1000:g} N: "
            "every force would be scaled wrongly",
            axis=settings.name, obj=od.RATED_FORCE,
        )  # fmt: skip
    return []


def _ratio(
    node: Node, settings: AxisSettings, numerator: ObjectRef, denominator: ObjectRef
) -> Fraction | None:
    """One factor of the drive, None where it does not offer it."""
    if not (node.has(numerator) and node.has(denominator)):
        return None
    top, bottom = node.read(numerator), node.read(denominator)
    if top <= 0 or bottom <= 0:
        raise ConfigurationError(
            f"factor group holds {top} / {bottom}", axis=settings.name, obj=numerator
        )
    return Fraction(top, bottom)
