"""What commands print for people: where it goes, and progress bars."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from stagectl.cli.options import is_json_on_stdout

if TYPE_CHECKING:
    from rich.console import Console

ProgressUpdate = Callable[[str, int, int], None]
"""Takes what is being done, the steps done and the number of steps."""


def make_console(*, stderr: bool = False) -> Console:
    """A console that prints every text as it is."""
    from stagectl.cli.plain_console import PlainConsole

    return PlainConsole(stderr=stderr)


def console_for(json_out: Path | None) -> Console:
    """The console that people read: standard error if the JSON goes to standard output."""
    return make_console(stderr=is_json_on_stdout(json_out))


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
