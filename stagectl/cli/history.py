"""`stagectl history`: what concerns the friction history as a whole."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.lazy import LazyGroup

COMMANDS = {
    "import": ("stagectl.cli.history:import_run", "File what a run's history did not get."),
}


@click.group(name="history", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """The friction history: every estimate of every run (stage.db, or PostgreSQL)."""


@click.command("import", short_help="File what a run's history did not get.")
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--history", metavar="FILE|URL", help="File it there [the run's own history].")
def import_run(run: Path, history: str | None) -> None:
    """File all estimates of RUN, a folder, that its history does not have.

    A run goes on where its history is locked, full or out of reach, and says so at its end; the
    next run of the stage with the same history files what is missing by itself, as long as the
    folder is where it was. Importing twice adds nothing.
    """
    from stagectl.errors import UnusableInput
    from stagectl.history import file_run, open_history, runs_in

    for noted in runs_in(run):
        where = history or noted.where
        if where is None:
            raise UnusableInput(f"{run}: was made without a history; name one: --history")
        opened = open_history(where, write=True)
        try:
            added = file_run(opened, noted)
        finally:
            opened.close()
        total = len(noted.estimates)
        click.echo(
            f"{added} of {total} estimates filed in {opened.name}"
            if added
            else f"all {total} estimates are in {opened.name} already"
        )
