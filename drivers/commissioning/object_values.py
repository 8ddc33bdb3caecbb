"""Values of objects for people: in SI units, or in words where they are codes.

A value has the unit that the machine file states for the axis, as in a run; whether the drive means
the same is checked at boot (`drivers.drive.units`), not here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from canopen.objectdictionary import FLOAT_TYPES, INTEGER_TYPES, ODVariable, datatypes

from drivers import objects as od
from drivers.canopen import Value, error_text, register_text
from drivers.commissioning.status import in_words, mode_text
from drivers.drive import Status, dimension, unit
from drivers.errors import ConfigurationError, shown
from drivers.motion import command_text
from drivers.objects import ObjectRef, Quantity
from drivers.settings import AxisSettings

_TYPE_NAMES = {n: name for name, n in vars(datatypes).items() if isinstance(n, int)}
"""CiA 301 data types by number."""
_BYTES = (datatypes.OCTET_STRING, datatypes.DOMAIN)
_TEXTS = (datatypes.VISIBLE_STRING, datatypes.UNICODE_STRING)


def _status_text(word: int) -> str:
    """A statusword in words, with the bits that depend on the mode by number."""
    words = in_words(word)
    if word & Status.TARGET_REACHED:
        words += "; target reached"
    return words + "".join(f"; bit {bit}" for bit in (12, 13) if word >> bit & 1)


def _error_text(code: int) -> str:
    return error_text(code).removesuffix(f" (0x{code:04X})")


_WORDS: dict[int, Callable[[int], str]] = {
    0x1001: register_text, 0x603F: _error_text, 0x6040: command_text, 0x6041: _status_text,
    0x6060: mode_text, 0x6061: mode_text,
}  # fmt: skip
"""Objects that are codes: their values in words."""
_HEX = {0x1000, 0x1001, 0x603F, 0x6040, 0x6041, 0x60FD, 0x60FE}
_COMMUNICATION = range(0x1000, 0x2000)
_HEX_BITS = 32
"""Communication objects this wide are COB-IDs, mappings and numbers of vendors."""

_QUANTITIES: dict[tuple[int, int], Quantity] = {
    (ref.index, ref.sub): ref.quantity
    for ref in vars(od).values()
    if isinstance(ref, ObjectRef) and ref.quantity is not None
} | {
    (0x6062, 0): Quantity.POSITION, (0x60F4, 0): Quantity.POSITION,
    (0x606B, 0): Quantity.VELOCITY, (0x607F, 0): Quantity.VELOCITY, (0x6082, 0): Quantity.VELOCITY,
    (0x60C5, 0): Quantity.ACCELERATION, (0x60C6, 0): Quantity.ACCELERATION,
    (0x6074, 0): Quantity.FORCE,
    (0x60E0, 0): Quantity.FORCE, (0x60E1, 0): Quantity.FORCE,
}  # fmt: skip
"""Also of objects that the host does not use."""
_PREFIXED = {
    "m": ("mm", 1e3), "m/s": ("mm/s", 1e3), "s": ("ms", 1e3),
    "rad": ("mrad", 1e3), "rad/s": ("mrad/s", 1e3),
}  # fmt: skip
"""How people read an SI unit on a stage."""


def reference(variable: ODVariable) -> ObjectRef:
    """The object with its name in the EDS, and its quantity where it is known."""
    name = str(variable.name)
    whole = without_unit(getattr(variable.parent, "name", ""))
    if variable.subindex and whole and not name.startswith(whole):
        name = f"{whole}: {name}"
    place = variable.index, variable.subindex
    return ObjectRef(*place, _printable(name), _QUANTITIES.get(place))


def type_name(variable: ODVariable) -> str:
    """The data type of an object, as CiA 301 names it."""
    number = int(variable.data_type or 0)
    return _TYPE_NAMES.get(number, f"data type 0x{number:04X}")


def unit_of(obj: ObjectRef, axis: AxisSettings) -> tuple[float, str] | None:
    """One unit of an object: its SI value and unit; None where it has none, or none is known."""
    if obj.quantity is None or obj.quantity is Quantity.CODE:
        return None
    return unit(axis, obj), dimension(axis, obj)


def meaning(obj: ObjectRef, value: Value, axis: AxisSettings | None) -> str | None:
    """A value in words or SI units; None where it has neither."""
    if not isinstance(value, int):
        return None
    if obj.index in _WORDS and obj.sub == 0:
        return _WORDS[obj.index](value)
    found = None if axis is None else unit_of(obj, axis)
    if found is None:
        return None
    size, name = found
    name, factor = _PREFIXED.get(name, (name, 1.0))
    return f"{_number(value * size * factor)} {name}"


def raw_text(obj: ObjectRef, value: Value, bits: int) -> str:
    """A value as the drive holds it."""
    if isinstance(value, bytes | bytearray):
        return value.hex(" ") or "empty"
    if isinstance(value, str):
        return _printable(value)
    wide = obj.index in _COMMUNICATION and obj.sub and bits == _HEX_BITS
    if isinstance(value, int) and (obj.index in _HEX or wide):
        return f"0x{value & (1 << bits) - 1:0{bits // 4}X}"
    return str(value)


def parse(text: str, variable: ODVariable, axis: AxisSettings) -> Value:
    """A value for an object, as the EDS types it, checked against its range.

    Args:
        text: a number in the drive's unit (0x for hexadecimal), a text, or for bytes their
            hexadecimal digits.
        variable: the object.
        axis: for messages.

    Raises:
        ConfigurationError: the value is not one of this object.
    """
    kind, obj = variable.data_type, reference(variable)
    wanted = type_name(variable)
    value: Value
    try:
        if kind in INTEGER_TYPES or kind == datatypes.BOOLEAN:
            value = int(text, 0)
        elif kind in FLOAT_TYPES:
            value = float(text)
            if not math.isfinite(value):
                raise ValueError
        elif kind in _TEXTS:
            value = text
        elif kind in _BYTES:
            value = bytes.fromhex(re.sub(r"^0x", "", text))
        else:
            raise ConfigurationError(f"is {wanted}: cannot be written", axis=axis.name, obj=obj)
    except ValueError:
        raise ConfigurationError(
            f"is {wanted}, not {shown(text)}", axis=axis.name, obj=obj
        ) from None
    _check_range(value, variable, axis)
    return value


def _check_range(value: Value, variable: ODVariable, axis: AxisSettings) -> None:
    low, high = variable.min, variable.max
    if variable.data_type in INTEGER_TYPES:
        bits, signed = len(variable), variable.data_type in datatypes.SIGNED_TYPES
        least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        low, high = least if low is None else low, most if high is None else high
    if not isinstance(value, int | float) or variable.data_type == datatypes.BOOLEAN:
        return
    if not ((low is None or value >= low) and (high is None or value <= high)):
        raise ConfigurationError(
            f"must be in {low}..{high}, is {value}", axis=axis.name, obj=reference(variable)
        )


def _number(value: float) -> str:
    """Without an exponent, as people compare figures; to a picometre in mm."""
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def without_unit(name: str) -> str:
    """A name of the EDS without "[nm]", or what else it has in brackets, at its end."""
    return re.sub(r" *\[[^\]]*\]$", "", name)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)
