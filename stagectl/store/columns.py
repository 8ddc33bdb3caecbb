"""Columns of data files of other programs: MATLAB (4 to 7 by scipy, 7.3 as HDF5) and text.

Text files may begin with other lines, have a second line of header with units, text columns beside
the numbers, and any of , ; tab or blanks between cells; with ; a comma may be the decimal point.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput

FloatArray = npt.NDArray[np.float64]
TEXT_FILES = (".csv", ".txt", ".tsv", ".dat", ".log")


class Columns:
    """The columns of one file, by name; a text file without a header has numbers from 1.

    Args:
        path: of the file.
        preamble: lines of a text file before its header; None: found by itself.

    Raises:
        UnusableInput: the file cannot be read; names file, row and cause.
    """

    def __init__(self, path: Path, preamble: int | None = None) -> None:
        if not path.is_file():
            raise UnusableInput(f"{path}: {'is not a file' if path.exists() else 'no such file'}")
        self.path = path
        self._numbers: dict[str, FloatArray] = {}
        self._not_numbers: dict[str, str] = {}
        suffix = path.suffix.lower()
        if suffix == ".mat":
            self._numbers = _hdf5(path) if h5py.is_hdf5(path) else _matlab(path)
        elif suffix in TEXT_FILES:
            self._read_text(preamble)
        else:
            known = ", ".join(TEXT_FILES)
            raise UnusableInput(f"{path}: {suffix or 'no suffix'}: only .mat and {known} are read")
        if not self._numbers and not self._not_numbers:
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
            has = ", ".join(sorted(self._numbers)) or "none with numbers"
            raise UnusableInput(f"{self.path}: no column {name!r}; it has {has}")
        return self._numbers[name]

    def _read_text(self, preamble: int | None) -> None:
        try:
            text = self.path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeError) as error:
            raise UnusableInput(f"{self.path}: not readable text") from error
        lines = [
            (number, line)
            for number, line in enumerate(text.splitlines(), start=1)
            if line.strip() and not line.startswith("#") and number > (preamble or 0)
        ]
        if not lines:
            raise UnusableInput(f"{self.path}: empty")
        rows, decimal = _cells([line for _, line in lines])
        width = len(rows[0]) if preamble is not None else _usual_width(rows)
        first = next(
            (
                i
                for i, row in enumerate(rows)
                if len(row) == width and any(_number(cell, decimal) is not None for cell in row)
            ),
            len(rows),
        )
        header = first
        while header and len(rows[header - 1]) == width:
            header -= 1
        names = rows[header] if header < first else [str(i + 1) for i in range(width)]
        body = rows[first:]
        if not body:
            raise UnusableInput(f"{self.path}: no row of numbers")
        for (number, _), row in zip(lines[first:], body, strict=True):
            if len(row) != width:
                raise UnusableInput(
                    f"{self.path}: row {number}: {len(row)} values, the first row has {width}"
                )
        for c, name in enumerate(names):
            values = np.empty(len(body))
            for r, row in enumerate(body):
                value = _number(row[c], decimal) if row[c] else np.nan
                if value is None:
                    place = f"row {lines[first + r][0]}, column {name}"
                    self._not_numbers[name] = f"{place}: {row[c]!r} is not a number"
                    break
                values[r] = value
            else:
                self._numbers[name] = values


def _cells(lines: Sequence[str]) -> tuple[list[list[str]], str]:
    """The cells of each line, and the decimal point."""
    uses = {d: sum(d in line for line in lines) for d in ";\t,"}
    delimiter = max(uses, key=lambda d: uses[d])
    if uses[delimiter] < len(lines) / 2:  # a preamble may hold any character
        return [re.split(r"\s+", line.strip()) for line in lines], "."
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]
    last = lines[-1]
    return rows, "," if delimiter == ";" and "," in last and "." not in last else "."


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    """The number of cells that most lines have; of two as frequent, that of the earlier line."""
    counts = Counter(len(row) for row in rows)
    return max(counts, key=lambda width: counts[width])


def _number(text: str, decimal: str = ".") -> float | None:
    try:
        return float(text.replace(decimal, "."))
    except ValueError:
        return None


def _matlab(path: Path) -> dict[str, FloatArray]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path)
    except (MatReadError, ValueError, TypeError, OSError, NotImplementedError, KeyError) as error:
        line = str(error).split("\n")[0]
        raise UnusableInput(f"{path}: not a readable .mat file: {line}") from error
    return {
        name: np.asarray(values, dtype=np.float64).ravel()
        for name, values in content.items()
        if not name.startswith("__")
        and isinstance(values, np.ndarray)
        and values.dtype.kind in "fiub"
        and max(values.shape, default=0) == values.size > 1
    }


def _hdf5(path: Path) -> dict[str, FloatArray]:
    try:
        with h5py.File(path, "r") as file:
            return {
                name: np.asarray(member[()], dtype=np.float64).ravel()
                for name, member in file.items()
                if isinstance(member, h5py.Dataset)
                and member.dtype.kind in "fiub"
                and max(member.shape, default=0) == member.size > 1
            }
    except (OSError, RuntimeError, KeyError) as error:
        raise UnusableInput(f"{path}: not a readable .mat file (version 7.3)") from error
