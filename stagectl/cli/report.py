"""`stagectl report`: summary and report of a run, made again from its recording."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.options import RECORDING


@click.command
@click.argument("run", type=RECORDING)
def command(run: Path) -> None:
    """Make summary.json and report.html of RUN again, from its recording.

    RUN is the folder of a run or a calibration, or one of its recordings. Nothing else is read:
    after an update, the documents are as this version makes them, and a recording alone is enough.
    """
    from stagectl.calibration import rewrite_all_documents

    _, written = rewrite_all_documents(run)
    click.echo(f"written: {', '.join(map(str, written))}")
