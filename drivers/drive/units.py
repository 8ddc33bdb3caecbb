"""Units of a drive: what it says of them, compared with the settings, before power.

Position: 0x608F encoder increments per motor revolution, 0x6091 gear, 0x6092 feed, which together
give the encoder increments of one position unit; and 0x60A8. Velocity and acceleration: 0x6096 and
0x6097, increments per second (squared) for one unit; and 0x60A9 and 0x60AA. Force: 0x6076 [mN];
force values are in thousandths of it (CiA 402).

0x60A8 to 0x60AA are notations of CiA 303-2 in the layout of CiA 402-2: bits 31..24 hold a power of
ten, 23..16 what is counted, 15..8 by what it is divided, 7..0 nothing. Notations from 0xA0 on are
drive makers', and named only where makers agree. What a revolution moves is the settings' `lead`.
Which increments a rate counts differs from drive to drive: the settings have to state it as well.

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
from drivers.drive.scaling import dimension, unit
from drivers.errors import ConfigurationError, RefusedError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

TOLERANCE = 1e-6
"""Relative deviation due to factors that are fractions of 32-bit numbers."""
RATED_FORCE_TOLERANCE = 1e-3
"""Relative deviation of 0x6076, which a drive calculates from its motor's data."""
_REVERSED = 0xC0
"""Bits 7 (position) and 6 (velocity) of 0x607E."""
INCREMENT = "increment"


@dataclass(frozen=True, slots=True)
class StatedUnit:
    """One unit of a drive.

    Attributes:
        words: what it is.
        base: "m", "rad" or `INCREMENT`; "" for anything else.
        per: power of the time that it is divided by: 1 for velocities, 2 for accelerations.
        size: in base / s^per; 0 where it is not understood.
    """

    words: str
    base: str
    per: int
    size: float


_COUNTED = {
    0x00: ("numbers without dimension", "", 0, 0.0),
    0x01: ("metres", "m", 0, 1.0),
    0x10: ("radians", "rad", 0, 1.0),
    0x40: ("gon", "rad", 0, math.pi / 200),
    0x41: ("degrees", "rad", 0, math.pi / 180),
    0x42: ("minutes of arc", "rad", 0, math.pi / 10_800),
    0x43: ("seconds of arc", "rad", 0, math.pi / 648_000),
    0xB4: ("revolutions", "rad", 0, 2 * math.pi),
    0xB5: ("increments", INCREMENT, 0, 1.0),
    0xC0: ("revolutions per minute", "rad", 1, 2 * math.pi / 60),
    0xC1: ("inches", "m", 0, 0.0254),
}
"""What is counted: words, base, power of the time in it, SI value."""

_TIMES = {
    0x00: ("", 0, 1.0),
    0x03: ("second", 1, 1.0),
    0x47: ("minute", 1, 60.0),
    0x48: ("hour", 1, 3600.0),
    0x57: ("second squared", 2, 1.0),
    0xA0: ("second cubed", 3, 1.0),
}
"""What it is divided by: words, power of the time, SI value."""


@dataclass(frozen=True, slots=True)
class _Quantity:
    """A quantity whose unit CiA 303-2 states.

    Attributes:
        name: of the quantity; a rate's unit is `name`_unit in the settings.
        notation: the object that states its unit.
        example: an object in that unit.
        per: power of the time that the unit is divided by.
    """

    name: str
    notation: ObjectRef
    example: ObjectRef
    per: int


_POSITION = _Quantity("position", od.POSITION_UNIT, od.TARGET_POSITION, 0)
_VELOCITY = _Quantity("velocity", od.VELOCITY_UNIT, od.PROFILE_VELOCITY, 1)
_ACCELERATION = _Quantity("acceleration", od.ACCELERATION_UNIT, od.PROFILE_ACCELERATION, 2)
_RATES = (
    (_VELOCITY, od.VELOCITY_FACTOR, od.VELOCITY_DIVISOR),
    (_ACCELERATION, od.ACCELERATION_FACTOR, od.ACCELERATION_DIVISOR),
)
"""Factor and divisor state the unit of a rate, too."""


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
    for rate, factor, divisor in _RATES:
        _check_rate(node, settings, rate, factor, _ratio(node, settings, factor, divisor))
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


def _check_rate(
    node: Node, settings: AxisSettings, rate: _Quantity, factor: ObjectRef, ratio: Fraction | None
) -> None:
    """Velocity or acceleration, by its factor, of which `ratio` is the value, and notation."""
    if ratio is not None:
        _compare(float(ratio) * settings.encoder_increment, settings, rate, factor)
    stated = _stated(node, rate.notation)
    if stated is not None:
        _compare(_size(stated, settings, rate), settings, rate, rate.notation)
    elif ratio is None and not getattr(settings, f"{rate.name}_unit"):
        one, si = unit(settings, rate.example), dimension(settings, rate.example)
        raise ConfigurationError(
            f"the drive does not say what it counts {rate.name} in; the machine file must: "
            f"{_to_write(rate, one)} if it is {one:g} {si}",
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
    except RefusedError:
        return None


def read_unit(value: int) -> StatedUnit:
    """The unit that a value of 0x60A8, 0x60A9 or 0x60AA states.

    Args:
        value: 32 bits, with or without sign.
    """
    value &= 0xFFFFFFFF
    prefix, counted, time, rest = value.to_bytes(4, "big")
    power = prefix - 256 if prefix > 127 else prefix
    unknown = (f"an unknown unit 0x{counted:02X}", "", 0, 0.0)
    words, base, own, size = _COUNTED.get(counted, unknown)
    by, per, seconds = _TIMES.get(time, (f"an unknown unit 0x{time:02X}", 0, math.inf))
    if power:
        words = f"10^{power} {words}"
    if by:
        words = f"{words} per {by}"
    if rest:
        words, size = f"{words}, and 0x{rest:02X} in bits that mean nothing", 0.0
    return StatedUnit(words, base, own + per, float(10.0**power) * size / seconds)


def _size(stated: int, settings: AxisSettings, quantity: _Quantity) -> float:
    """One unit as stated [SI].

    Raises:
        ConfigurationError: the axis cannot use such a unit, or not by this statement alone.
    """
    found = read_unit(stated)
    kind, base = ("rotary", "rad") if settings.rotary else ("linear", "m")
    why = f"a {kind} axis cannot use it for {quantity.name}"
    if found.per == quantity.per and found.size > 0:
        if found.base == base:
            return found.size
        if found.base == INCREMENT:
            size = found.size * settings.encoder_increment
            if quantity is _POSITION or getattr(settings, f"{quantity.name}_unit"):
                return size
            why = f"increments of what is not known; {_to_write(quantity, size)} if of the encoder"
        elif found.base == "rad":
            if settings.lead:
                return found.size * settings.lead / (2 * math.pi)
            why += " without lead, the travel per revolution, in its drive section"
    raise ConfigurationError(
        f"says 0x{stated:08X}: {found.words}; {why}", axis=settings.name, obj=quantity.notation
    )


def _to_write(quantity: _Quantity, size: float) -> str:
    return f"add {quantity.name}_unit: {size:.9g} to its drive section"


def _compare(found: float, settings: AxisSettings, quantity: _Quantity, ref: ObjectRef) -> None:
    """Refuses a unit [SI] other than that of the settings; `ref` states it."""
    expected, si = unit(settings, quantity.example), dimension(settings, quantity.example)
    if not math.isclose(found, expected, rel_tol=TOLERANCE):
        raise ConfigurationError(
            f"one {quantity.name} unit is {found:.6g} {si}, the settings say {expected:.6g} {si}; "
            f"{_to_write(quantity, found)} if the drive is right",
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
    one, rated = settings.rated_force_unit, settings.rated_force
    held = node.read(od.RATED_FORCE) * one
    off = abs(held - rated)
    if off > max(RATED_FORCE_TOLERANCE * rated, 0.5 * one):
        raise ConfigurationError(
            f"the drive says {held:g} N, the settings {rated:g} N: all forces would be scaled "
            f"wrongly; if it does not count in {one:g} N, write rated_force_unit",
            axis=settings.name, obj=od.RATED_FORCE,
        )  # fmt: skip
    if off > TOLERANCE * rated and off > 0.5 * one:
        return [f"{od.RATED_FORCE} is {held:.6g} N, not {rated:.6g} N: forces are off by as much"]
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
