"""Tables of positions: comma-separated, with a header line, `#` comments, SI numbers or units.

`sites.csv` has the columns x, y; `offsets.csv` has site, dx, dy. The columns may be in any order;
an unknown column is an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stagectl.config.parsing.units import LENGTH, parse_quantity
from stagectl.config.parsing.validation import suggest
from stagectl.config.parsing.yaml_nodes import Mark, describe_value, format_problem, read_text
from stagectl.errors import ConfigError
from stagectl.plain_text import one_line
from stagectl.recipe.model import Pair

MAX_ROWS = 100_000


@dataclass(frozen=True, slots=True)
class Row:
    """A row: its place in the file, site number (None without that column) and pair [m]."""

    name: str
    mark: Mark
    site: int | None
    pair: Pair

    def problem(self, reason: str) -> str:
        """The line of a problem with this row."""
        return format_problem(self.name, self.mark, "", reason)


def read_sites(path: Path) -> tuple[Row, ...]:
    """Rows of `x, y`, and optionally `site`, which must then count from 1.

    Raises:
        ConfigError: every problem of the table, one line each.
    """
    rows = _read(path, ("x", "y"), ("site",))
    problems = [
        row.problem(f"site must be {number}, is {row.site}: sites count from 1 without a gap")
        for number, row in enumerate(rows, 1)
        if row.site not in (None, number)
    ]
    if problems:
        raise ConfigError(problems[:100])
    return rows


def read_offsets(path: Path) -> tuple[Row, ...]:
    """Rows of `site, dx, dy`, each site at most once.

    Raises:
        ConfigError: every problem of the table, one line each.
    """
    rows = _read(path, ("site", "dx", "dy"), ())
    seen: set[int | None] = set()
    problems = []
    for row in rows:
        if row.site in seen:
            problems.append(row.problem(f"site {row.site} is listed twice"))
        seen.add(row.site)
    if problems:
        raise ConfigError(problems[:100])
    return rows


def _read(path: Path, required: Sequence[str], optional: Sequence[str]) -> tuple[Row, ...]:
    name = str(path)
    lines = [
        (number, line)
        for number, line in enumerate(read_text(path).splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    known = [*required, *optional]
    if not lines:
        reason = f"is empty: a header line {','.join(required)} is expected"
        raise ConfigError(format_problem(name, Mark(1, 1), "", reason))
    header_line, header_text = lines[0]
    header = [cell.strip() for cell in header_text.split(",")]
    problems: list[str] = []
    for label in header:
        if label not in known or header.count(label) > 1:
            reason = "duplicate column" if label in known else "unknown column"
            reason += "" if label in known else suggest(label, known)
            problems.append(format_problem(name, Mark(header_line, 1), label, reason))
    for label in required:
        if label not in header:
            problems.append(format_problem(name, Mark(header_line, 1), label, "is missing"))
    if problems:
        raise ConfigError(dict.fromkeys(problems))
    if not 1 <= len(lines) - 1 <= MAX_ROWS:
        reason = f"must have 1 to {MAX_ROWS} rows below the header, has {len(lines) - 1}"
        raise ConfigError(format_problem(name, Mark(header_line, 1), "", reason))

    x, y = [label for label in required if label != "site"]
    rows: list[Row] = []
    for number, line in lines[1:]:
        cells = line.split(",")
        if len(cells) != len(header):
            reason = f"must have {len(header)} cells, has {len(cells)}"
            problems.append(format_problem(name, Mark(number, 1), "", reason))
            continue
        values: dict[str, float] = {}
        column = 1
        for label, cell in zip(header, cells, strict=True):
            try:
                values[label] = _site(cell) if label == "site" else _length(cell)
            except ValueError as error:
                indent = len(cell) - len(cell.lstrip())
                mark = Mark(number, column + indent)
                problems.append(format_problem(name, mark, label, str(error)))
            column += len(cell) + 1
        if len(values) == len(header):
            site = int(values["site"]) if "site" in values else None
            rows.append(Row(name, Mark(number, 1), site, (values[x], values[y])))
    if problems:
        raise ConfigError(problems[:100])
    return tuple(rows)


def _site(cell: str) -> int:
    text = cell.strip()
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) >= 1):
        raise ValueError(f"must be a site number from 1, is {describe_value(text)}")
    return int(text)


def _length(cell: str) -> float:
    text = cell.strip()
    try:
        value: object = float(text)
    except ValueError:
        value = text
    if "_" in text or not text:
        raise ValueError(f"must be a length, is {one_line(repr(text), 40)}")
    return parse_quantity(value, LENGTH)
