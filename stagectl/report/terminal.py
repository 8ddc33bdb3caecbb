"""Outlines on a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from rich import box
from rich import table as rich_table
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.text import Text

from stagectl.report.outline import Fact, Outline, Section, Table

_STYLES = {"": "", "good": "green", "warning": "yellow", "bad": "red"}
_LABEL_WIDTH = 9
"""Characters of "empirical", the longest label."""


WIDTH = 80
"""Columns that every table is laid out for."""
_ENDLESS = 10_000


@dataclass(frozen=True, slots=True)
class Wide:
    """At least as wide as the tables: a narrow terminal wraps their lines instead of cutting."""

    inner: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield from console.render(self.inner, options.update(width=max(options.max_width, WIDTH)))


@dataclass(frozen=True, slots=True)
class Whole:
    """A table as wide as what is in it: names and figures stay whole, one row is one line."""

    table: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        free = options.update(width=_ENDLESS)
        yield from console.render(
            self.table, options.update(width=console.measure(self.table, options=free).maximum)
        )


def print_outline(outline: Outline, *more: RenderableType) -> RenderableType:
    """An outline, and more before the command to continue; to be printed with `crop=False`."""
    head = Text(f"{outline.title} {outline.subject}".strip() + ": ")
    for badge in outline.badges:
        head.append(f"{badge.text}. ", _STYLES[badge.level])
    head.append(outline.headline)
    parts: list[RenderableType] = [head]
    if outline.reason:
        parts.append(Text(outline.reason))
    if outline.figures:
        grid = rich_table.Table.grid(padding=(0, 2, 0, 0))
        for value, meaning in outline.figures:
            grid.add_row(Text(value), Text(meaning))
        parts.append(grid)
    parts += [
        Text(f"{name[:1].lower()}{name[1:]}: {value}")
        for name, value in outline.facts.items()
        if value
    ]
    parts += [whole(fact.text, _STYLES[fact.level]) for fact in outline.notices]
    parts.append(print_sections(outline.sections.values()))
    parts += more
    if outline.command is not None:
        parts.append(whole(f"to continue: {outline.command}"))
    return Wide(Group(*parts))


def print_sections(sections: Iterable[Section]) -> RenderableType:
    """Sections one below the other, to be printed with `crop=False`."""
    return Wide(Group(*(part for section in sections for part in _section(section))))


def _section(section: Section) -> Iterator[RenderableType]:
    """A section's title, its table, and its facts beside their label."""
    if not section or section.on_page:
        return
    if section.table is not None or not section.label:
        yield Text(section.title)  # a table breaks a title at its own width
    if section.table is not None and section.table.rows:
        yield print_table(section.table)
    if section.facts:
        yield _facts(section)


def print_table(table: Table) -> RenderableType:
    """A table without the columns that only pages have."""
    shown = [i for i, title in enumerate(table.titles) if title not in table.on_page]
    drawn = rich_table.Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for i in shown:
        drawn.add_column(table.titles[i], justify="right" if table.has_figures(i) else "left")
    for row in table.rows:
        drawn.add_row(*(_cell(row[i]) for i in shown))
    return drawn


def whole(text: str, style: str = "") -> Text:
    """A line with a command to copy: only the terminal itself may break it."""
    return Text(text, style=style, no_wrap=True, overflow="ignore")


def _cell(cell: str | Fact) -> Text:
    return Text(cell) if isinstance(cell, str) else Text(cell.text, _STYLES[cell.level])


def _facts(section: Section) -> RenderableType:
    """Labels in a column of their own, so that long texts wrap beside them."""
    grid = rich_table.Table.grid(padding=(0, 2, 0, 0))
    grid.add_column(min_width=_LABEL_WIDTH if section.label else 0, no_wrap=True)
    grid.add_column(overflow="fold")
    for fact in section.facts[: section.most]:
        label = section.label if fact.label is None else fact.label
        grid.add_row(Text(label, _STYLES[fact.level]), Text(fact.text))
        for line in fact.details:
            grid.add_row("", Text(line))
    if len(section.facts) > section.most:
        grid.add_row("", f"and {len(section.facts) - section.most} more")
    return grid
