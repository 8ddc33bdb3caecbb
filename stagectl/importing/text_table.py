"""Text files of other programs as a table: names, and cells row by row.

They may begin with other lines, have more lines of header (units, or those of a TwinCAT scope with
numbers of their own), a header behind # or %, text columns beside the numbers, delimiters at the
end of each line, a mark of the end, and any of , ; tab or blanks between cells; with ; or tab a
comma may be the decimal point. Text is UTF-8, UTF-16 with its mark, or else Windows-1252.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stagectl.errors import UnusableInput

_COMMENT = ("#", "%")
_END = "EOF"
"""The last line of some exports."""
_JUDGED = 50
"""Rows at the end that show which columns have numbers."""


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table.

    Attributes:
        names: of the columns, repeated ones as "name (2)"; numbers from 1 where the file has no
            header.
        rows: cells of each row, as many as names.
        lines: number of each row's line in the file.
        decimal: the decimal point.
    """

    names: list[str]
    rows: list[list[str]]
    lines: list[int]
    decimal: str


def read_table(path: Path, preamble: int | None) -> TextTable:
    """The table in a text file.

    Args:
        path: of the file.
        preamble: lines before its header; None: found by itself.

    Raises:
        UnusableInput: the file cannot be read; names file, row and cause.
    """
    lines, comments = [], []
    for number, line in enumerate(_read_text(path).splitlines(), start=1):
        if not line.strip() or number <= (preamble or 0):
            continue
        if line.startswith(_COMMENT):
            comments.append((number, line.lstrip("#% \t")))
        else:
            lines.append((number, line))
    if lines and lines[-1][1].rstrip(";,\t ") == _END:
        lines.pop()
    if not lines:
        raise UnusableInput(f"{path}: empty")
    delimiter, decimal = _find_delimiter([line for _, line in lines])
    rows = _split([line for _, line in lines], delimiter)
    width = len(rows[0]) if preamble is not None else _usual_width(rows)
    first = _first_row(rows, width, decimal)
    if first is None:
        raise UnusableInput(f"{path}: no row of numbers")
    body, numbers = rows[first:], [number for number, _ in lines[first:]]
    for number, row in zip(numbers, body, strict=True):
        if len(row) != width:
            raise UnusableInput(
                f"{path}: row {number}: {len(row)} values, the first row has {width}"
            )
    if width > 1 and not any(row[-1] for row in body):
        width -= 1  # each line ends with a delimiter
        body = [row[:-1] for row in body]
    above = [_trimmed(row, width) for row in rows[_block(lines[:first]) : first]]
    behind = [line for number, line in comments if number < numbers[0]][-1:]
    names = _header(above) or _header([_trimmed(r, width) for r in _split(behind, delimiter)])
    return TextTable(
        _distinct(names or list(map(str, range(1, width + 1)))), body, numbers, decimal
    )


def to_number(text: str, decimal: str = ".") -> float | None:
    """The number in a cell; None where it is none."""
    try:
        return float(text.replace(decimal, "."))
    except ValueError:
        return None


def _read_text(path: Path) -> str:
    try:
        content = path.read_bytes()
        if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return content.decode("utf-16")
        try:
            return content.decode("utf-8-sig")
        except UnicodeDecodeError:
            if b"\0" in content:
                raise
            return content.decode("cp1252")
    except (OSError, UnicodeError) as error:
        raise UnusableInput(f"{path}: not readable text") from error


def _find_delimiter(lines: Sequence[str]) -> tuple[str | None, str]:
    """What separates cells, None for blanks; and the decimal point."""
    uses = {d: sum(d in line for line in lines) for d in ";\t,"}
    delimiter = max(uses, key=lambda d: uses[d])
    if uses[delimiter] < len(lines) / 2:  # a preamble may hold any character
        return None, "."
    last = lines[-1]
    return delimiter, "," if delimiter in ";\t" and "," in last and "." not in last else "."


def _split(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """The cells of each line."""
    if delimiter is None:
        return [re.split(r"\s+", line.strip()) for line in lines]
    return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    """The number of cells that most lines have; of two as frequent, that of the earlier line."""
    counts = Counter(len(row) for row in rows)
    return max(counts, key=lambda width: counts[width])


def _first_row(rows: Sequence[Sequence[str]], width: int, decimal: str) -> int | None:
    """The first row of numbers; lines of the header have text in the first column of numbers."""
    full = [(number, row) for number, row in enumerate(rows) if len(row) == width]
    last = [row for _, row in full[-_JUDGED:]]
    filled = [sum(to_number(row[c], decimal) is not None for row in last) for c in range(width)]
    if not any(filled):
        return None
    column = next(c for c, count in enumerate(filled) if 2 * count >= max(filled))
    for number, row in full:
        if to_number(row[column], decimal) is not None:
            return number
        if not row[column] and any(to_number(cell, decimal) is not None for cell in row):
            return number
    return None


def _distinct(names: Sequence[str]) -> list[str]:
    """Names with a number behind those that have been there before."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found


def _trimmed(row: list[str], width: int) -> list[str] | None:
    """A line above the numbers, if it is as wide as they are, delimiters at its end aside."""
    while len(row) > width and not row[-1]:
        row = row[:-1]
    return row if len(row) == width else None


def _block(above: Sequence[tuple[int, str]]) -> int:
    """Index of the first line of the last ones that no empty line parts."""
    breaks = [i for i in range(1, len(above)) if above[i][0] > above[i - 1][0] + 1]
    return breaks[-1] if breaks else 0


def _header(above: Sequence[list[str] | None]) -> list[str] | None:
    """The first of the lines directly above the numbers that are as wide as they are."""
    header = None
    for row in reversed(above):
        if row is None:
            break
        header = row
    return header
