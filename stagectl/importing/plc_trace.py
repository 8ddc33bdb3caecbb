"""Columns of a trace that CODESYS saved: .trace or .xml, with the times of each variable.

A column has the name of its variable. `Timestamp` are the times of the first one, in the trace's
unit (milliseconds or microseconds); a variable that was sampled at other times has
`NAME.Timestamp` beside it.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput

FloatArray = npt.NDArray[np.float64]
TIME = "Timestamp"


def read_plc_trace(path: Path) -> dict[str, FloatArray]:
    """All variables of numbers of a trace, by name, and their times.

    Raises:
        UnusableInput: the file cannot be read, or holds no samples; names file and variable.
    """
    try:
        root = ElementTree.parse(path).getroot()  # noqa: S314  the user's own file
    except (ElementTree.ParseError, OSError, UnicodeError, LookupError) as error:
        raise UnusableInput(f"{path}: not a readable trace: {error}") from error
    found: dict[str, FloatArray] = {}
    for variable in root.iter("TraceVariable"):
        name = variable.get("VarName", "")
        values, time = (_numbers(variable.findtext(part)) for part in ("Values", "Timestamps"))
        if values is None or time is None:
            continue
        if len(values) != len(time):
            raise UnusableInput(f"{path}: {name}: {len(values)} values at {len(time)} times")
        found[name] = values
        if not np.array_equal(found.setdefault(TIME, time), time):
            found[f"{name}.{TIME}"] = time
    if not found:
        raise UnusableInput(f"{path}: no TraceVariable with samples of numbers")
    return found


def _numbers(text: str | None) -> FloatArray | None:
    """Numbers with commas between them; None where there are none."""
    try:
        return np.array([float(part) for part in (text or "").split(",")])
    except ValueError:
        return None
