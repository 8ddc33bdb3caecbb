"""Units of a drive: its factor group and SI units, compared with the settings.

Position: 0x608F encoder increments per motor revolution, 0x6091 gear, 0x6092 feed; together they
give the encoder increments of one position unit. Velocity and acceleration: 0x6096 and 0x6097, with
increments per second (squared) for one unit, or 0x60A9 and 0x60AA, the unit as a power of ten of
m/s and m/s^2. Force: 0x6076 [mN]; force values are in thousandths of it (CiA 402).

Where a drive lacks these objects the settings are trusted, which is reported. A unit of velocity or
acceleration that is no power of ten of m/s or m/s^2 (rpm, degrees, increments) is refused.
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
"""Relative deviation due to factors that are fractions of 32-bit numbers."""
_METRE, _SECOND, _SECOND_SQUARED = 0x01, 0x03, 0x57
"""Notations of CiA 303-2 in 0x60A9 and 0x60AA."""
_NOTATIONS = {
    0x00: "without dimension", 0x01: "m", 0x03: "s", 0x10: "rad", 0x40: '"', 0x41: "\u00b0",
    0x42: "'", 0x47: "min", 0x48: "h", 0xA1: "in", 0xB4: "revolutions", 0xB5: "increments",
    0x57: "s^2", 0xC1: "in",
}  # fmt: skip
"""What CiA 303-2 and drives call the notations that a unit of position or time may have."""
_REVERSED = 0xC0
"""Bits 7 (position) and 6 (velocity) of 0x607E."""


@dataclass(frozen=True, slots=True)
class _Rate:
    """A velocity or acceleration: its objects, and the time notation of its unit (CiA 303-2)."""

    name: str
    unit: str
    factor: ObjectRef
    divisor: ObjectRef
    si_unit: ObjectRef
    time_notation: int


_VELOCITY = _Rate("velocity", "m/s", od.VELOCITY_FACTOR, od.VELOCITY_DIVISOR, od.VELOCITY_UNIT,
                  _SECOND)  # fmt: skip
_ACCELERATION = _Rate("acceleration", "m/s^2", od.ACCELERATION_FACTOR, od.ACCELERATION_DIVISOR,
                      od.ACCELERATION_UNIT, _SECOND_SQUARED)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Scale:
    """SI values of one unit of the CAN integers: `increment` [m], `force` [N] (rated / 1000)."""

    increment: float
    force: float


def check_units(node: Node, settings: AxisSettings) -> list[str]:
    """Compares the units that the drive reports with the settings.

    Returns:
        What the drive does not report, one clause each.

    Raises:
        ConfigurationError: the units differ or are invalid; names the object and both values.
        NodeError: the drive does not answer.
    """
    unreported = _check_position(node, settings)
    _check_rate(node, settings, _VELOCITY, settings.velocity_unit_si)
    _check_rate(node, settings, _ACCELERATION, settings.acceleration_unit)
    _check_polarity(node, settings)
    return unreported + _check_force(node, settings)


def _check_position(node: Node, settings: AxisSettings) -> list[str]:
    unreported, factor = [], Fraction(1)
    for numerator, denominator, power in (
        (od.ENCODER_INCREMENTS, od.ENCODER_REVOLUTIONS, 1),
        (od.GEAR_MOTOR, od.GEAR_SHAFT, 1),
        (od.FEED, od.FEED_REVOLUTIONS, -1),
    ):
        ratio = _ratio(node, settings, numerator, denominator)
        if ratio is None:
            unreported.append(
                f"{numerator} is not offered: one position unit is assumed to be "
                f"{settings.increment:g} m"
            )
        else:
            factor *= ratio**power
    if unreported:
        return unreported
    unit = float(factor) * settings.encoder_increment
    if not math.isclose(unit, settings.increment, rel_tol=TOLERANCE):
        raise ConfigurationError(
            f"factor group: one position unit is {float(factor):.6g} encoder increments of "
            f"{settings.encoder_increment:.6g} m, which is {unit:.6g} m; the settings say "
            f"{settings.increment:.6g} m",
            axis=settings.name, obj=od.FEED,
        )  # fmt: skip
    return []


def _check_rate(node: Node, settings: AxisSettings, rate: _Rate, expected: float) -> None:
    ratio = _ratio(node, settings, rate.factor, rate.divisor)
    found, ref = None, rate.factor
    if ratio is not None:
        found = float(ratio) * settings.encoder_increment
    elif node.has(rate.si_unit) and node.read(rate.si_unit):  # 0: none is stated
        found, ref = _power_of_ten(node.read(rate.si_unit), settings, rate), rate.si_unit
    if found is not None and not math.isclose(found, expected, rel_tol=TOLERANCE):
        raise ConfigurationError(
            f"one {rate.name} unit is {found:.6g} {rate.unit}, the settings say "
            f"{expected:.6g} {rate.unit}",
            axis=settings.name, obj=ref,
        )  # fmt: skip


def _power_of_ten(unit: int, settings: AxisSettings, rate: _Rate) -> float:
    """One unit [m/s or m/s^2] by 0x60A9 or 0x60AA: prefix, numerator, denominator, reserved.

    Raises:
        ConfigurationError: it is another unit than metres, which the host does not convert.
    """
    unit &= 0xFFFFFFFF
    prefix, numerator, denominator = unit >> 24, unit >> 16 & 0xFF, unit >> 8 & 0xFF
    power = prefix - 256 if prefix > 127 else prefix
    if (numerator, denominator) != (_METRE, rate.time_notation):
        meaning = " per ".join(
            _NOTATIONS.get(part, f"an unknown notation 0x{part:02X}")
            for part in (numerator, denominator)
        )
        factor = f"10^{power} " if power else ""
        raise ConfigurationError(
            f"0x{unit:08X} is {factor}{meaning}; only powers of ten of {rate.unit} are supported",
            axis=settings.name, obj=rate.si_unit,
        )  # fmt: skip
    return 10.0**power


def _check_polarity(node: Node, settings: AxisSettings) -> None:
    """0x607E reverses positions and velocities but not forces: offsets would push the wrong way."""
    polarity = node.read(od.POLARITY) if node.has(od.POLARITY) else 0
    if polarity & _REVERSED:
        raise ConfigurationError(
            f"0x{polarity & 0xFF:02X} reverses positions or velocities but not forces; set it to "
            "0 and choose the direction in the setup of motor and encoder",
            axis=settings.name, obj=od.POLARITY,
        )  # fmt: skip


def _check_force(node: Node, settings: AxisSettings) -> list[str]:
    if not node.has(od.RATED_FORCE):
        return [
            f"{od.RATED_FORCE} is not offered: the rated force is assumed to be "
            f"{settings.rated_force:g} N"
        ]
    held, rated = node.read(od.RATED_FORCE), round(settings.rated_force * 1000)
    if held != rated:
        raise ConfigurationError(
            f"the drive says {held / 1000:g} N, the settings {rated / 1000:g} N: "
            "all forces would be scaled wrongly",
            axis=settings.name, obj=od.RATED_FORCE,
        )  # fmt: skip
    return []


def _ratio(
    node: Node, settings: AxisSettings, numerator: ObjectRef, denominator: ObjectRef
) -> Fraction | None:
    """One factor of the drive, None where it is not offered."""
    if not (node.has(numerator) and node.has(denominator)):
        return None
    top, bottom = node.read(numerator), node.read(denominator)
    if top <= 0 or bottom <= 0:
        raise ConfigurationError(
            f"factor group holds {top} / {bottom}", axis=settings.name, obj=numerator
        )
    return Fraction(top, bottom)
