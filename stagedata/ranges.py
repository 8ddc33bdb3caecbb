"""Ranges of settings, stated in their annotations and checked when they are made.

A field is `Positive`, `NotNegative`, `Annotated` with a bound of annotated_types, or a `Literal`.
The models of files validate the same annotations (`stagectl.config`).
"""

from __future__ import annotations

import math
from functools import cache
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Interval, Le

Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Whole = Annotated[int, Ge(0)]
Count = Annotated[int, Ge(1)]


def check_ranges(settings: Any) -> None:
    """Refuse settings outside the ranges in the annotations of their class, a dataclass.

    Raises:
        ValueError: the first one's name, its range and value.
    """
    for name, ranges in _ranges(settings.__class__).items():
        value = getattr(settings, name)
        for expected in ranges if value is not None else ():
            if not _is_within(value, expected):
                raise ValueError(f"{name}: must be {_describe(expected)}, is {_shown(value)}")


@cache
def _ranges(kind: type) -> dict[str, tuple[Any, ...]]:
    """Field -> its bounds, and the tuples of values of its literals."""
    hints = get_type_hints(kind, include_extras=True)
    found = {name: tuple(_found(hint)) for name, hint in hints.items()}
    return {name: ranges for name, ranges in found.items() if ranges}


def _found(hint: Any) -> list[Any]:
    if get_origin(hint) is Literal:
        return [get_args(hint)]
    if get_origin(hint) is Annotated:
        return [m for m in hint.__metadata__ if isinstance(m, (Interval, Gt, Ge, Le))]
    one_of = [part for part in get_args(hint) if part is not NoneType]
    return _found(one_of[0]) if len(one_of) == 1 < len(get_args(hint)) else []


def _is_within(value: Any, expected: Any) -> bool:
    match expected:
        case tuple():
            return value in expected
        case Interval(ge=low, le=high):
            return bool(low <= value <= high)
        case Gt(bound):
            return bool(bound < value < math.inf)
        case Ge(bound):
            return bool(bound <= value < math.inf)
    return bool(value <= expected.le)


def _describe(expected: Any) -> str:
    match expected:
        case tuple():
            return f"one of {', '.join(map(str, expected))}"
        case Interval(ge=low, le=high):
            return f"{low:g}..{high:g}"
        case Gt(bound):
            return f"> {bound:g}"
        case Ge(bound):
            return f">= {bound:g}"
    return f"<= {expected.le:g}"


def _shown(value: object) -> str:
    return f"{value:.12g}" if isinstance(value, float) else repr(value)
