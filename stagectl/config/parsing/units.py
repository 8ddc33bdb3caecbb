"""Quantities in files: a plain number is in SI units; a string is a number with a unit.

`80 um`, `5 ms`, `0.5 m/s`, `3 m/s^2`, `30 N s/m`, `0.6 N/um`, `16.07 MN/(m s)`. Units are m, g, s,
N, Hz with the prefixes n, u (or the micro sign), m, c, k, M, combined by `/`, `*` or a space. The
dimension is checked. The conversion is exact (decimal), so `80 um` is the same float as `80e-6`.
Used only at the border: inside the program all quantities are SI floats.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import Annotated, Final

from annotated_types import Ge, Gt
from pydantic import BeforeValidator

from stagectl.config.parsing.validation import refusal
from stagectl.config.parsing.yaml_nodes import describe_value
from stagectl.plain_text import one_line

Exponents = tuple[int, int, int]  # of metre, kilogram, second


@dataclass(frozen=True, slots=True)
class Dimension:
    """The dimension of a quantity: its name, SI exponents, an example with a unit, its SI unit."""

    name: str
    exponents: Exponents
    example: str
    unit: str


NUMBER: Final = Dimension("a number", (0, 0, 0), "", "")
LENGTH: Final = Dimension("a length", (1, 0, 0), "80 um", "m")
TIME: Final = Dimension("a time", (0, 0, 1), "5 ms", "s")
VELOCITY: Final = Dimension("a velocity", (1, 0, -1), "10 mm/s", "m/s")
ACCELERATION: Final = Dimension("an acceleration", (1, 0, -2), "3 m/s^2", "m/s^2")
JERK: Final = Dimension("a jerk", (1, 0, -3), "200 m/s^3", "m/s^3")
FORCE: Final = Dimension("a force", (1, 1, -2), "40 N", "N")
MASS: Final = Dimension("a mass", (0, 1, 0), "8 kg", "kg")
FREQUENCY: Final = Dimension("a frequency", (0, 0, -1), "1.5 kHz", "Hz")
STIFFNESS: Final = Dimension("a stiffness", (0, 1, -2), "0.6 N/um", "N/m")
DAMPING: Final = Dimension("a damping", (0, 1, -1), "20 N s/m", "N s/m")
FORCE_RATE: Final = Dimension("a force per time", (1, 1, -3), "600 N/s", "N/s")
INTEGRAL_GAIN: Final = Dimension("a stiffness per time", (0, 1, -3), "16 MN/(m s)", "N/(m s)")

_DIMENSIONS: Final = (
    LENGTH, TIME, VELOCITY, ACCELERATION, JERK, FORCE, MASS, FREQUENCY, STIFFNESS, DAMPING,
    FORCE_RATE, INTEGRAL_GAIN,
)  # fmt: skip
_BASE: Final[dict[str, tuple[int, Exponents]]] = {
    "m": (0, (1, 0, 0)),
    "g": (-3, (0, 1, 0)),
    "s": (0, (0, 0, 1)),
    "N": (0, (1, 1, -2)),
    "Hz": (0, (0, 0, -1)),
}
_PREFIX: Final = {
    "n": -9, "u": -6, "\N{MICRO SIGN}": -6, "\N{GREEK SMALL LETTER MU}": -6,
    "m": -3, "c": -2, "k": 3, "M": 6,
}  # fmt: skip
_QUANTITY = re.compile(r"([-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]{1,3})?)\s*(.*)\Z")
_TOKEN = re.compile(
    r"\s*(?:([A-Za-z\u00b5\u03bc]+)(?:\^?(-?[1-4]|[\u00b2\u00b3]))?|([/*\u00b7()]))\s*"
)
_SUPERSCRIPT: Final = {"\N{SUPERSCRIPT TWO}": 2, "\N{SUPERSCRIPT THREE}": 3}


def parse_unit(text: str) -> tuple[int, Exponents]:
    """A unit such as `N/(m s)` as (power of ten to SI, SI exponents).

    Raises:
        ValueError: unknown unit.
    """
    tokens: list[tuple[str, str, str]] = []
    position = 0
    while position < len(text) and len(tokens) < 20:
        match = _TOKEN.match(text, position)
        if match is None:
            break
        tokens.append((match[1] or "", match[2] or "", match[3] or ""))
        position = match.end()
    if position < len(text) or not tokens:
        raise ValueError(text)

    def product(closing: str) -> tuple[int, Exponents]:
        ten, total, sign = 0, (0, 0, 0), 1
        expect_factor = True
        while tokens:
            symbol, power, operator = tokens.pop(0)
            if operator == ")":
                if closing == ")" and not expect_factor:
                    return ten, total
                raise ValueError(text)
            if operator in ("/", "*", "\u00b7"):
                if expect_factor:
                    raise ValueError(text)
                sign, expect_factor = (-1 if operator == "/" else 1), True
                continue
            factor_ten, factor = product(")") if operator == "(" else _symbol(symbol, power)
            ten += sign * factor_ten
            total = (
                total[0] + sign * factor[0],
                total[1] + sign * factor[1],
                total[2] + sign * factor[2],
            )
            sign, expect_factor = 1, False
        if closing or expect_factor:
            raise ValueError(text)
        return ten, total

    return product("")


def _symbol(symbol: str, power: str) -> tuple[int, Exponents]:
    """A base unit with its prefix, raised to a power."""
    if symbol in _BASE:
        ten, dim = _BASE[symbol]
    elif symbol[:1] in _PREFIX and symbol[1:] in _BASE:
        ten, dim = _BASE[symbol[1:]]
        ten += _PREFIX[symbol[0]]
    else:
        raise ValueError(symbol)
    n = _SUPERSCRIPT.get(power) or int(power or 1)
    return ten * n, (dim[0] * n, dim[1] * n, dim[2] * n)


def parse_quantity(value: object, dimension: Dimension) -> float:
    """A value from a file as an SI float.

    Args:
        value: a number in SI units, or a string of number and unit.
        dimension: required.

    Raises:
        ValueError: not a finite number, a missing or unknown unit, or the wrong dimension; the
            message says which, and what was expected.
    """
    expected = f"must be {dimension.name}"
    if dimension.example:
        expected += f" (SI, or a text such as '{dimension.example}')"
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{expected}, is {describe_value(value)}")
    if not isinstance(value, str):
        if not math.isfinite(value):
            raise ValueError(f"must be a finite number, is {value}")
        return float(value)
    text = value.strip()
    match = _QUANTITY.match(text) if len(text) <= 64 else None
    if match is None:
        raise ValueError(f"{expected}, is {describe_value(value)}")
    number, unit = match[1], match[2]
    if not unit:
        raise ValueError(f"{expected}, is a text: write {one_line(number)} without quotes")
    try:
        ten, exponents = parse_unit(unit)
    except ValueError:
        raise ValueError(f"{expected}: unknown unit '{one_line(unit, 30)}'") from None
    if exponents != dimension.exponents:
        other = next((d.name for d in _DIMENSIONS if d.exponents == exponents), "something else")
        raise ValueError(f"{expected}, but {describe_value(value)} is {other}")
    try:
        result = float(Decimal(number) * Decimal(1).scaleb(ten))
    except (InvalidOperation, OverflowError):
        raise ValueError(f"{expected}, is {describe_value(value)}") from None
    if not math.isfinite(result):
        raise ValueError(f"must be a finite number, is {describe_value(value)}")
    return result


@dataclass(frozen=True, slots=True)
class Converter:
    """Makes an SI float of a value from a file; of a dimension, which the reference names."""

    dimension: Dimension

    def __call__(self, value: object) -> float:
        """`parse_quantity`, with its reason in the operator's words."""
        try:
            return parse_quantity(value, self.dimension)
        except ValueError as error:
            raise refusal(str(error)) from None


def _validator(dimension: Dimension) -> BeforeValidator:
    return BeforeValidator(Converter(dimension))


# Field types of the models: any value, > 0, >= 0.
Number = Annotated[float, _validator(NUMBER)]
Length = Annotated[float, _validator(LENGTH)]
PositiveNumber = Annotated[float, _validator(NUMBER), Gt(0)]
PositiveLength = Annotated[float, _validator(LENGTH), Gt(0)]
PositiveTime = Annotated[float, _validator(TIME), Gt(0)]
PositiveVelocity = Annotated[float, _validator(VELOCITY), Gt(0)]
PositiveAcceleration = Annotated[float, _validator(ACCELERATION), Gt(0)]
PositiveJerk = Annotated[float, _validator(JERK), Gt(0)]
PositiveForce = Annotated[float, _validator(FORCE), Gt(0)]
PositiveMass = Annotated[float, _validator(MASS), Gt(0)]
PositiveFrequency = Annotated[float, _validator(FREQUENCY), Gt(0)]
PositiveStiffness = Annotated[float, _validator(STIFFNESS), Gt(0)]
PositiveForceRate = Annotated[float, _validator(FORCE_RATE), Gt(0)]
NotNegativeNumber = Annotated[float, _validator(NUMBER), Ge(0)]
NotNegativeLength = Annotated[float, _validator(LENGTH), Ge(0)]
NotNegativeTime = Annotated[float, _validator(TIME), Ge(0)]
NotNegativeDamping = Annotated[float, _validator(DAMPING), Ge(0)]
NotNegativeIntegralGain = Annotated[float, _validator(INTEGRAL_GAIN), Ge(0)]
