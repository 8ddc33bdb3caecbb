"""`stagectl recover`: the recording of a run that was killed."""

from __future__ import annotations

from pathlib import Path

import click


@click.command
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False, exists=True))
def command(folder: Path) -> None:
    """Convert the journal that a killed run left in FOLDER into its recording.h5.

    `stagectl run --out FOLDER` does this by itself before it writes to the folder.
    """
    from stagectl.store import recover_folder

    recovered, log = recover_folder(folder)
    if recovered is not None:
        click.echo(recovered.describe())
    if log is not None:
        click.echo(f"its bus log is now {log}")
    if recovered is None and log is None:
        click.echo("nothing to recover")
