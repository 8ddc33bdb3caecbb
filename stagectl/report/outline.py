"""What a run, a calibration, a map or a diagnosis says: facts and tables in sections.

Built once; `terminal` prints it, the macros in `templates/outline.html.j2` make it part of a page.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

Level = Literal["", "good", "warning", "bad"]
_FIGURE = re.compile(r"$|\N{EN DASH}|[-+(]*\d")


@dataclass(frozen=True, slots=True)
class Fact:
    """A sentence.

    Attributes:
        text: of it.
        level: how good it is; "" for neither.
        details: more about it, a line each.
        share: between 0 and 1, drawn on pages; None for none.
        label: in place of its section's.
    """

    text: str
    level: Level = ""
    details: Sequence[str] = ()
    share: float | None = None
    label: str | None = None


Cell = str | Fact
"""Of a table: a text, or a fact where it has a level."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Attributes:
        titles: of the columns.
        rows: cells in the order of the columns.
        on_page: titles of columns that only pages have, for a terminal has 80 characters.
    """

    titles: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    on_page: Sequence[str] = ()

    def has_figures(self, column: int) -> bool:
        """Whether a column holds figures and no text: it is aligned to the right."""
        cells = (row[column] for row in self.rows)
        return all(_FIGURE.match(c if isinstance(c, str) else c.text) for c in cells)


@dataclass(frozen=True, slots=True)
class Section:
    """Facts and a table of one subject.

    Attributes:
        title: of the section.
        facts: in order.
        table: below them, or None.
        label: beside the first fact on a terminal, in place of the title.
        note: how to read it, for pages.
        most: facts that are shown at once; the others are counted on a terminal, folded on a page.
        on_page: only there.
    """

    title: str
    facts: Sequence[Fact] = ()
    table: Table | None = None
    label: str = ""
    note: str = ""
    most: int = 10
    on_page: bool = False

    def __bool__(self) -> bool:
        return bool(self.facts) or (self.table is not None and bool(self.table.rows))


@dataclass(frozen=True, slots=True)
class Outline:
    """All that is said.

    Attributes:
        title: what it is about.
        subject: of which stage.
        badges: verdicts in a word or two.
        headline: the result in a sentence or two.
        reason: more about it.
        facts: names and values of circumstances; those without a value are not shown.
        figures: values and meanings of the most important figures.
        notices: what else there is to know.
        sections: by name.
        command: that continues an interrupted run.
    """

    title: str
    subject: str
    badges: Sequence[Fact]
    headline: str
    reason: str = ""
    facts: Mapping[str, str | None] = field(default_factory=dict)
    figures: Sequence[tuple[str, str]] = ()
    notices: Sequence[Fact] = ()
    sections: Mapping[str, Section] = field(default_factory=dict)
    command: str | None = None
