"""`stagectl recover`: the recording of a run that was killed."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.files import InputFolder


@click.command
@click.argument("folder", type=InputFolder(exists=True))
def command(folder: Path) -> None:
    """Convert the journal that a killed run left in FOLDER into its recording.h5.

    Summary and report cover what was recorded. `stagectl run --resume FOLDER`
    does all this by itself.
    """
    from stagectl.calibration import rewrite_all_documents
    from stagectl.report import resume_command
    from stagectl.store import recover_folder

    recovered, log = recover_folder(folder)
    if recovered is not None:
        click.echo(recovered.describe())
    if log is not None:
        click.echo(f"its bus log is now {log}")
    if recovered is not None and recovered.path is not None:
        summary, written = rewrite_all_documents(recovered.path)
        click.echo(f"written: {', '.join(map(str, written))}")
        command = resume_command(summary)
        if command is not None:
            click.echo(f"to continue: {command}")
    if recovered is None and log is None:
        click.echo("nothing to recover")
