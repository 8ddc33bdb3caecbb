"""Tables on terminals that are narrower than they are."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.table import Table

WIDTH = 80
"""Columns that every table is laid out for."""
_ENDLESS = 10_000


@dataclass(frozen=True, slots=True)
class Wide:
    """At least as wide as the tables: a narrow terminal wraps their lines instead of cutting.

    To be printed with `crop=False`.
    """

    inner: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield from console.render(self.inner, options.update(width=max(options.max_width, WIDTH)))


@dataclass(frozen=True, slots=True)
class Whole:
    """A table as wide as what is in it: names and figures stay whole, one row is one line.

    To be printed with `crop=False`.
    """

    table: Table

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        free = options.update(width=_ENDLESS)
        yield from console.render(
            self.table, options.update(width=console.measure(self.table, options=free).maximum)
        )
