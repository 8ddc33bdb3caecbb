"""Columns of data files of other programs: MATLAB, NumPy, HDF5, CODESYS traces and text."""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput
from stagectl.importing.foreign_process import read_foreign
from stagectl.importing.text_table import read_table, to_number

FloatArray = npt.NDArray[np.float64]
_BINARY = (".mat", ".npz", ".h5", ".hdf5")
_TRACES = (".trace", ".xml")
_MOST_NAMES = 60
TIME = "Timestamp"


class Columns:
    """The columns of one file, by name; a text file without a header has numbers from 1.

    Args:
        path: of the file.
        preamble: lines of a text file before its header; None: found by itself.
        wanted: names of columns; of a binary file no others are read. None: all.

    Raises:
        UnusableInput: the file cannot be read; names file, row and cause.
    """

    def __init__(
        self, path: Path, preamble: int | None = None, wanted: Collection[str] | None = None
    ) -> None:
        if not path.is_file():
            raise UnusableInput(f"{path}: {'is not a file' if path.exists() else 'no such file'}")
        self.path = path
        self._numbers: dict[str, FloatArray] = {}
        self._names: list[str] = []
        self._not_numbers: dict[str, str] = {}
        self._texts: dict[str, list[str]] = {}
        suffix = path.suffix.lower()
        if suffix in _BINARY:
            self._numbers, self._names = read_foreign(path, wanted)
        elif suffix in _TRACES:
            self._numbers = read_plc_trace(path)
        else:
            self._read_text(preamble)
        self._names = self._names or list(self._numbers)
        if not self._names and not self._not_numbers:
            raise UnusableInput(f"{path}: no numeric column")

    def __contains__(self, name: str) -> bool:
        return name in self._numbers or name in self._not_numbers

    def __getitem__(self, name: str) -> FloatArray:
        """Values of a column, NaN where a cell is empty.

        Raises:
            UnusableInput: there is no such column, or it holds text.
        """
        if name in self._not_numbers:
            raise UnusableInput(f"{self.path}: {self._not_numbers[name]}")
        if name not in self._numbers:
            names = sorted(self._names)
            has = ", ".join(names[:_MOST_NAMES]) or "none with numbers"
            more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
            raise UnusableInput(f"{self.path}: no column {name!r}; it has {has}{more}")
        return self._numbers[name]

    def seconds(self, name: str, form: str | None = None) -> FloatArray | None:
        """A column of dates or times of day [s]; None where it is not one.

        Args:
            name: of the column.
            form: as strptime has it; None: ISO 8601, or hours, minutes and seconds with colons
                between them.

        Raises:
            UnusableInput: a cell does not have that form.
        """
        if name not in self._texts:
            return None
        try:
            return np.array([_seconds(text, form) for text in self._texts[name]])
        except ValueError as error:
            if form is None:
                return None
            raise UnusableInput(f"{self.path}: column {name}: {error}") from error

    def _read_text(self, preamble: int | None) -> None:
        table = read_table(self.path, preamble)
        for c, name in enumerate(table.names):
            values = np.empty(len(table.rows))
            for r, row in enumerate(table.rows):
                value = to_number(row[c], table.decimal) if row[c] else np.nan
                if value is None:
                    place = f"row {table.lines[r]}, column {name}"
                    self._not_numbers[name] = f"{place}: {row[c]!r} is not a number"
                    self._texts[name] = [row[c] for row in table.rows]
                    break
                values[r] = value
            else:
                self._numbers[name] = values


def _seconds(text: str, form: str | None) -> float:
    text = text.strip("\"' ")
    if form is None:
        text = text.replace(",", ".")
    if form is not None or "-" in text:
        moment = datetime.fromisoformat(text) if form is None else datetime.strptime(text, form)
        whole = moment.replace(tzinfo=None) - datetime(1970, 1, 1)
        return whole.total_seconds()
    parts = text.split(":")
    if not 2 <= len(parts) <= 3:
        raise ValueError(text)
    total = 0.0
    for part in parts:
        total = 60.0 * total + float(part)
    return total


def read_plc_trace(path: Path) -> dict[str, FloatArray]:
    """All variables of numbers of a trace that CODESYS saved, by name, and their times.

    `Timestamp` are the times of the first one, in the trace's unit (milliseconds or microseconds);
    a variable that was sampled at other times has `NAME.Timestamp` beside it.

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
