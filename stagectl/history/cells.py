"""Cells of a history as values: SQLite keeps anything in any column, and other programs may write.

What is not what its column says is one line that names the history, before it gets any further.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from stagectl.errors import UnusableInput
from stagectl.plain_text import find_control, one_line

_LAST = 253402300000.0
"""The end of the year 9999 [s since 1970]; calendars go no further."""
P = ParamSpec("P")
R = TypeVar("R")
H = TypeVar("H")
"""A history, with the name that messages give it."""


def reads(method: Callable[Concatenate[H, P], R]) -> Callable[Concatenate[H, P], R]:
    """Decorator of a history's reading method: damaged rows raise `UnusableInput`."""

    @wraps(method)
    def read(history: Any, /, *arguments: P.args, **keywords: P.kwargs) -> R:
        try:
            return method(history, *arguments, **keywords)
        except (ValueError, TypeError, OverflowError, struct.error, RecursionError) as error:
            raise UnusableInput(
                f"{history.name}: a row of it is damaged: {one_line(error, 200)}"
            ) from error

    return read


def number(cell: object, column: str) -> float:
    """A finite number.

    Raises:
        ValueError: it is none.
    """
    if not isinstance(cell, int | float) or not math.isfinite(cell):
        raise ValueError(f"{column}: must be a finite number, is {one_line(repr(cell), 40)}")
    return float(cell)


def optional_number(cell: object, column: str) -> float | None:
    """A finite number, or None."""
    return None if cell is None else number(cell, column)


def date(cell: object, column: str = "time") -> float:
    """A time that calendars have [s since 1970].

    Raises:
        ValueError: it is none.
    """
    seconds = number(cell, column)
    if abs(seconds) > _LAST:
        raise ValueError(f"{column}: {seconds:g} s since 1970 is no date")
    return seconds


def text(cell: object, column: str) -> str:
    """A text on one line.

    Raises:
        ValueError: it is none.
    """
    if not isinstance(cell, str):
        raise ValueError(f"{column}: must be text, is {type(cell).__name__}")
    if (reason := find_control(cell)) is not None:
        raise ValueError(f"{column}: {reason}")
    return cell


def optional_text(cell: object, column: str) -> str | None:
    """A text on one line, or None."""
    return None if cell is None else text(cell, column)


def place(x: object, y: object) -> tuple[float, float]:
    """A position [m] of columns of whole um.

    Raises:
        ValueError: they are none.
    """
    for column, cell in (("x_um", x), ("y_um", y)):
        if not isinstance(cell, int):
            raise ValueError(f"{column}: must be a whole number, is {one_line(repr(cell), 40)}")
    return number(x, "x_um") / 1e6, number(y, "y_um") / 1e6


def figures(cell: object) -> Mapping[str, float]:
    """Figures of an estimate, from JSON; names without control characters, finite values.

    Raises:
        ValueError: it is no such text.
    """
    found: Any = json.loads(cell) if isinstance(cell, str) else None
    if not isinstance(found, dict):
        raise ValueError("figures: must be an object in JSON")
    return {text(name, "figures"): number(value, name) for name, value in found.items()}
