"""Units of a drive: what it says of them, compared with the settings, before power.

Position: 0x608F encoder increments per motor revolution, 0x6091 gear, 0x6092 feed, which together
give the encoder increments of one position unit; and 0x60A8. Velocity and acceleration: 0x6096 and
0x6097, increments per second (squared) for one unit; and 0x60A9 and 0x60AA (`notation`). Force:
0x6076 [mN]; force values are in thousandths of it (CiA 402).

All that a drive says has to agree with the settings; a unit that is not understood is refused.
Where it says nothing of velocities or accelerations the settings have to, a default is no
knowledge; positions and forces are then trusted, which is reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from drivers import objects as od
from drivers.canopen import Node
from drivers.drive import notation
from drivers.drive.scaling import dimension, unit
from drivers.errors import ConfigurationError, NodeError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

TOLERANCE = 1e-6
"""Relative deviation due to factors that are fractions of 32-bit numbers."""
_REVERSED = 0xC0
"""Bits 7 (position) and 6 (velocity) of 0x607E."""


@dataclass(frozen=True, slots=True)
class _Quantity:
    """A quantity whose unit CiA 303-2 states.

    Attributes:
        name: of the quantity.
        notation: the object that states its unit.
        example: an object in that unit.
        per: power of the time that the unit is divided by.
    """

    name: str
    notation: ObjectRef
    example: ObjectRef
    per: int


@dataclass(frozen=True, slots=True)
class _Rate(_Quantity):
    """A velocity or acceleration: `factor` and `divisor` state its unit too; `key` sets it."""

    factor: ObjectRef
    divisor: ObjectRef
    key: str


_POSITION = _Quantity("position", od.POSITION_UNIT, od.TARGET_POSITION, 0)
_VELOCITY = _Rate("velocity", od.VELOCITY_UNIT, od.PROFILE_VELOCITY, 1,
                  od.VELOCITY_FACTOR, od.VELOCITY_DIVISOR, "velocity_unit")  # fmt: skip
_ACCELERATION = _Rate("acceleration", od.ACCELERATION_UNIT, od.PROFILE_ACCELERATION, 2,
                      od.ACCELERATION_FACTOR, od.ACCELERATION_DIVISOR,
                      "acceleration_unit")  # fmt: skip


def check_units(node: Node, settings: AxisSettings) -> list[str]:
    """Compares the units that the drive reports with the settings.

    Returns:
        What the drive does not report, one clause each.

    Raises:
        ConfigurationError: the units differ, are not understood, or nobody states them; names the
            object and what it says.
        NodeError: the drive does not answer.
    """
    unreported = _check_position(node, settings)
    _check_rate(node, settings, _VELOCITY, settings.velocity_unit > 0)
    _check_rate(node, settings, _ACCELERATION, settings.acceleration_unit > 0)
    _check_polarity(node, settings)
    return unreported + _check_force(node, settings)


def _check_position(node: Node, settings: AxisSettings) -> list[str]:
    """Factor group and 0x60A8; a clause for each missing factor where nothing else states it."""
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
    if not unreported:
        found = float(factor) * settings.encoder_increment
        if not math.isclose(found, settings.increment, rel_tol=TOLERANCE):
            raise ConfigurationError(
                f"factor group: one position unit is {float(factor):.6g} encoder increments of "
                f"{settings.encoder_increment:.6g} m, which is {found:.6g} m; the settings say "
                f"{settings.increment:.6g} m",
                axis=settings.name, obj=od.FEED,
            )  # fmt: skip
    stated = _stated(node, od.POSITION_UNIT)
    if stated is None:
        return unreported
    _compare(_size(stated, settings, _POSITION), settings, _POSITION, od.POSITION_UNIT)
    return []


def _check_rate(node: Node, settings: AxisSettings, rate: _Rate, is_written: bool) -> None:
    """Velocity or acceleration; `is_written`: the settings have its unit from the machine file."""
    ratio = _ratio(node, settings, rate.factor, rate.divisor)
    if ratio is not None:
        _compare(float(ratio) * settings.encoder_increment, settings, rate, rate.factor)
    stated = _stated(node, rate.notation)
    if stated is not None:
        _compare(_size(stated, settings, rate), settings, rate, rate.notation)
    elif ratio is None and not is_written:
        one, si = unit(settings, rate.example), dimension(settings, rate.example)
        raise ConfigurationError(
            f"the drive does not say what it counts {rate.name} in; the machine file must: "
            f"add {rate.key}: {one:g} to its drive section if it is {one:g} {si}",
            axis=settings.name, obj=rate.notation,
        )  # fmt: skip


def _stated(node: Node, ref: ObjectRef) -> int | None:
    """A notation that the drive states, also where its EDS does not list the object.

    Returns:
        None where the drive does not have it, or it is 0 (CiA 303-2: without dimension).

    Raises:
        NodeError: no answer.
    """
    try:
        return node.read(ref) & 0xFFFFFFFF or None
    except NodeError as refused:
        if refused.abort_code is None:
            raise
        return None


def _size(stated: int, settings: AxisSettings, quantity: _Quantity) -> float:
    """One unit as stated [SI].

    Raises:
        ConfigurationError: the axis cannot use such a unit.
    """
    found = notation.read(stated)
    kind, base = ("rotary", "rad") if settings.rotary else ("linear", "m")
    if found.per == quantity.per and found.size > 0:
        if found.base == base:
            return found.size
        if found.base == notation.INCREMENT and quantity is _POSITION:
            # which increments a velocity counts, and per which time, differs from drive to drive
            return found.size * settings.encoder_increment
    raise ConfigurationError(
        f"says 0x{stated:08X}: {found.words}; a {kind} axis cannot use it for {quantity.name}",
        axis=settings.name, obj=quantity.notation,
    )  # fmt: skip


def _compare(found: float, settings: AxisSettings, quantity: _Quantity, ref: ObjectRef) -> None:
    """Refuses a unit [SI] other than that of the settings; `ref` states it."""
    expected, si = unit(settings, quantity.example), dimension(settings, quantity.example)
    if not math.isclose(found, expected, rel_tol=TOLERANCE):
        raise ConfigurationError(
            f"one {quantity.name} unit is {found:.6g} {si}, the settings say {expected:.6g} {si}",
            axis=settings.name, obj=ref,
        )  # fmt: skip


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
