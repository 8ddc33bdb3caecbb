"""What commands print for people: where it goes, and progress bars."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import is_json_on_stdout, write_json

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table
    from rich.text import TextType

ProgressUpdate = Callable[[str, int, int], None]
"""Takes what is being done, the steps done and the number of steps."""


def make_console(*, stderr: bool = False) -> Console:
    """A console that prints every text as it is."""
    from stagectl.cli.plain_terminal import PlainConsole

    return PlainConsole(stderr=stderr)


def console_for(json_out: Path | None) -> Console:
    """The console that people read: standard error if the JSON goes to standard output."""
    return make_console(stderr=is_json_on_stdout(json_out))


def show_result(values: Any, json_out: Path | None, *shown: RenderableType) -> None:
    """Write a result as JSON, and print it for people unless JSON takes standard output.

    Args:
        values: for JSON.
        json_out: `--json`.
        shown: tables, and lines that only the terminal breaks.
    """
    write_json(values, json_out)
    if is_json_on_stdout(json_out):
        return
    for each in shown:
        if isinstance(each, str):
            click.echo(each)
        else:
            make_console().print(each, crop=False)


def make_table(
    title: TextType,
    columns: Sequence[str],
    rows: Iterable[Sequence[TextType] | None],
    right: Container[str] = (),
    **look: Any,
) -> Table:
    """A table with a title; a row that is None is a line.

    Args:
        title: above it, on the left.
        columns: their titles.
        rows: cells in the order of the columns.
        right: titles of the columns that are aligned to the right.
        look: of `rich.table.Table`.
    """
    from rich.table import Table

    table = Table(title=title, title_justify="left", **look)
    for column in columns:
        justify = "right" if column in right else "left"
        table.add_column(column, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for row in rows:
        if row is None:
            table.add_section()
        else:
            table.add_row(*row)
    return table


@contextmanager
def progress_bar(console: Console, activity: str) -> Iterator[ProgressUpdate]:
    """A progress bar that vanishes at the end; not drawn unless the console is a terminal.

    Args:
        console: to draw on.
        activity: shown until the first update.

    Yields:
        A function that updates the bar.
    """
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (
        TextColumn("{task.description}", style="progress.description", markup=False),
        BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
    )  # fmt: skip
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(activity, total=None)
        yield lambda what, done, total: bar.update(
            task, description=what, completed=done, total=total
        )


def join_phases(phases: Sequence[str], update: ProgressUpdate) -> ProgressUpdate:
    """Progress of several phases on one bar that never goes back; each has an equal share of it.

    Args:
        phases: the names that the progress is reported under, in order.
        update: of the bar.
    """
    furthest = 0

    def advance(what: str, done: int, total: int) -> None:
        nonlocal furthest
        furthest = max(furthest, round(100 * (phases.index(what) + done / max(total, 1))))
        update(what, furthest, 100 * len(phases))

    return advance
