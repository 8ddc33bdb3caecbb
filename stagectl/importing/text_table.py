"""Text files of other programs as a table: names, and cells row by row.

They may begin with other lines, have more lines of header (units, or those of a TwinCAT scope with
numbers of their own), a header behind # or %, text columns beside the numbers, delimiters at the
end of each line, and any of , ; tab or blanks between cells; with ; or tab a comma may be the
decimal point. Thousands may be grouped, by the other of the two. What follows the last row of
numbers is left out: sums, marks of the end, a line that was cut. Text is UTF-8, UTF-16 with its
mark, or else Windows-1252.
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
_GROUPED = {
    ".": re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?"),
    ",": re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?"),
}
"""Numbers with groups of thousands, by their decimal point."""
_JUDGED = 50
"""Rows at the end that show which columns have numbers."""


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table.

    Attributes:
        names: of the columns, repeated ones as "name (2)"; the number, from 1, of a column without
            a name.
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
    if not lines:
        raise UnusableInput(f"{path}: empty")
    delimiter = _find_delimiter([line for _, line in lines])
    rows = _split([line for _, line in lines], delimiter)
    full = width = len(rows[0]) if preamble is not None else _usual_width(rows)
    decimal = _find_decimal(rows, width, delimiter)
    of_numbers = _rows_of_numbers(rows, width, decimal)
    if not of_numbers:
        raise UnusableInput(f"{path}: no row of numbers")
    first, stop = of_numbers[0], of_numbers[-1] + 1
    body, numbers = rows[first:stop], [number for number, _ in lines[first:stop]]
    for number, row in zip(numbers, body, strict=True):
        if len(row) != width:
            raise UnusableInput(
                f"{path}: row {number}: {len(row)} values, the first row has {width}"
            )
    while width > 1 and not any(row[width - 1] for row in body):
        width -= 1  # each line ends with a delimiter, or with an empty column
    above = [_header_of(row, width, full) for row in rows[_block(lines[:first]) : first]]
    behind = [line for number, line in comments if number < numbers[0]][-1:]
    names = _header(above) or _header(
        [_header_of(row, width, full) for row in _split(behind, delimiter)]
    )
    return TextTable(
        _distinct(names or list(map(str, range(1, width + 1)))),
        [row[:width] for row in body],
        numbers,
        decimal,
    )


def to_number(text: str, decimal: str = ".") -> float | None:
    """The number in a cell; None where it is none."""
    group = "." if decimal == "," else ","
    if group in text:
        if not _GROUPED[decimal].fullmatch(text):
            return None
        text = text.replace(group, "")
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
        raise UnusableInput(
            f"{path}: not readable text; export it as .csv, .mat, .npz or .h5"
        ) from error


def _find_delimiter(lines: Sequence[str]) -> str | None:
    """What separates cells; None for blanks."""
    uses = {d: sum(d in line for line in lines) for d in ";\t,"}
    delimiter = max(uses, key=lambda d: uses[d])
    # A preamble may hold any character.
    return delimiter if uses[delimiter] >= len(lines) / 2 else None


def _find_decimal(rows: Sequence[Sequence[str]], width: int, delimiter: str | None) -> str:
    """The decimal point with which more of the last cells are numbers."""
    if delimiter not in (";", "\t"):
        return "."
    last = [row for row in rows if len(row) == width][-_JUDGED:]
    cells = [cell for row in last for cell in row if "," in cell or "." in cell]
    points, commas = (
        sum(to_number(cell, decimal) is not None for cell in cells) for decimal in ".,"
    )
    alike = commas == points and any("," in cell for cell in cells)
    return "," if commas > points or alike else "."


def _split(lines: Sequence[str], delimiter: str | None) -> list[list[str]]:
    """The cells of each line."""
    if delimiter is None:
        return [re.split(r"\s+", line.strip()) for line in lines]
    return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=delimiter)]


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    """The number of cells that most lines have; of two as frequent, that of the earlier line."""
    counts = Counter(len(row) for row in rows)
    return max(counts, key=lambda width: counts[width])


def _rows_of_numbers(rows: Sequence[Sequence[str]], width: int, decimal: str) -> list[int]:
    """Indices of the rows of numbers; other lines have text in the first column of numbers."""
    full = [(index, row) for index, row in enumerate(rows) if len(row) == width]
    last = [row for _, row in full[-_JUDGED:]]
    filled = [sum(to_number(row[c], decimal) is not None for row in last) for c in range(width)]
    if not any(filled):
        return []
    column = next(c for c, count in enumerate(filled) if 2 * count >= max(filled))

    def has_numbers(row: Sequence[str]) -> bool:
        if row[column]:
            return to_number(row[column], decimal) is not None
        return any(to_number(cell, decimal) is not None for cell in row)

    return [index for index, row in full if has_numbers(row)]


def _distinct(names: Sequence[str]) -> list[str]:
    """Names with a number behind those that have been there before, or in place of an empty one."""
    seen: Counter[str] = Counter()
    found = []
    for number, given in enumerate(names, start=1):
        name = given or str(number)
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found


def _header_of(row: list[str], width: int, full: int) -> list[str] | None:
    """A line above the numbers, as far as these go; None where it has not as many cells.

    Args:
        row: its cells.
        width: columns with values.
        full: cells of a row of numbers, empty ones at its end included.
    """
    while len(row) > full and not row[-1]:
        row = row[:-1]
    return row[:width] if width <= len(row) <= full else None


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
