"""`stagectl history`: the friction history, and its maintenance."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.files import HistoryFile
from stagectl.cli.lazy import LazyGroup
from stagectl.cli.options import FILE

COMMANDS = {
    "list": ("stagectl.cli.history_list:list_runs", "List runs and the friction they have shown."),
    "import": ("stagectl.cli.history:import_run", "Add a run's estimates to its history."),
}


@click.group(name="history", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """The friction history: every estimate of every run, in a stage.db file or PostgreSQL."""


@click.command("import")
@click.argument("run", type=FILE)
@click.option(
    "--history", type=HistoryFile(), help="Import into this one.  [default: the run's own]"
)
def import_run(run: Path, history: str | None) -> None:
    """Import the estimates of RUN, a run's folder, that are missing in its history.

    A run continues if its history is locked, full or out of reach, and reports that at its end.
    The next run with the same history imports what is missing by itself, unless the folder has
    been moved. Importing twice adds nothing.
    """
    from stagectl.errors import UnusableInput
    from stagectl.history import file_run, open_history, runs_in

    for noted in runs_in(run):
        where = history or noted.where
        if where is None:
            raise UnusableInput(f"{run}: was made without a history; name one with --history")
        opened = open_history(where, write=True)
        try:
            added = file_run(opened, noted)
        finally:
            opened.close()
        total = len(noted.estimates)
        click.echo(
            f"{added} of {total} estimates imported into {opened.name}"
            if added
            else f"all {total} estimates are already in {opened.name}"
        )
