"""Units as 0x60A8 to 0x60AA state them: notations of CiA 303-2 in the layout of CiA 402-2.

Bits 31..24 hold a power of ten, 23..16 what is counted, 15..8 by what it is divided, 7..0 nothing.
Notations from 0xA0 on are drive makers', and named only where makers agree. The length of a
revolution or of an increment is not known here, and no unit is made one of another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

INCREMENT = "increment"


@dataclass(frozen=True, slots=True)
class Unit:
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
    0x00: ("numbers without dimension", "", 0.0),
    0x01: ("metres", "m", 1.0),
    0x10: ("radians", "rad", 1.0),
    0x40: ("gon", "rad", math.pi / 200),
    0x41: ("degrees", "rad", math.pi / 180),
    0x42: ("minutes of arc", "rad", math.pi / 10_800),
    0x43: ("seconds of arc", "rad", math.pi / 648_000),
    0xB4: ("revolutions", "rad", 2 * math.pi),
    0xB5: ("increments", INCREMENT, 1.0),
    0xC0: ("revolutions per minute", "", 0.0),
    0xC1: ("inches", "", 0.0),
}
"""What is counted: words, base, SI value."""

_TIMES = {
    0x00: ("", 0, 1.0),
    0x03: ("second", 1, 1.0),
    0x47: ("minute", 1, 60.0),
    0x48: ("hour", 1, 3600.0),
    0x57: ("second squared", 2, 1.0),
    0xA0: ("second cubed", 3, 1.0),
}
"""What it is divided by: words, power of the time, SI value."""


def read(value: int) -> Unit:
    """The unit that a value of 0x60A8, 0x60A9 or 0x60AA states.

    Args:
        value: 32 bits, with or without sign.
    """
    value &= 0xFFFFFFFF
    prefix, counted, time, rest = value.to_bytes(4, "big")
    power = prefix - 256 if prefix > 127 else prefix
    words, base, size = _COUNTED.get(counted, (f"an unknown unit 0x{counted:02X}", "", 0.0))
    by, per, seconds = _TIMES.get(time, (f"an unknown unit 0x{time:02X}", 0, math.inf))
    if power:
        words = f"10^{power} {words}"
    if by:
        words = f"{words} per {by}"
    if rest:
        words, size = f"{words}, and 0x{rest:02X} in bits that mean nothing", 0.0
    return Unit(words, base, per, float(10.0**power) * size / seconds)
