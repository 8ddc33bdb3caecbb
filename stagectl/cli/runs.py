"""`stagectl runs`: the runs in a folder."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.console import make_console
from stagectl.cli.files import InputFolder
from stagectl.cli.options import JSON_OUT, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from rich.console import RenderableType

    from stagectl.run import ListedRun

_STYLES = {"completed": "green", "aborted": "yellow", "fault": "red", "killed": "red"}
_OUTCOME, _FOLDER, _COMMENT = 16, 40, 24
"""Most columns for an outcome and the name of a run's folder; least for comments."""


@click.command
@click.argument("folder", type=InputFolder(), default=Path("runs"))
@JSON_OUT
def command(folder: Path, json_out: Path | None) -> None:
    """List the runs in FOLDER [runs], oldest first: when, what, on which wafer, by whom, outcome.

    A killed run is listed with what it recorded ('stagectl recover' makes its recording); one in
    progress is `running`. With --json also stage, comment and the progress of each run.
    """
    from stagectl.run import list_runs

    found = list_runs(folder)
    values = [{**asdict(run), "folder": str(run.folder)} for run in found]
    write_json({"format": "stagectl-runs", "version": 1, "runs": values}, json_out)
    if is_json_on_stdout(json_out):
        return
    make_console().print(_table(found) if found else f"no runs in {folder}")


def _table(found: list[ListedRun]) -> RenderableType:
    """A row per run; lot, wafer and operator have a column where any run names one."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    named = [key for key in ("lot", "wafer", "operator") if any(getattr(run, key) for run in found)]
    table.add_column("started", no_wrap=True)
    for title in ("recipe", *named):
        table.add_column(title, overflow="fold", min_width=len(title))
    table.add_column("outcome", width=min(max(len(_outcome(run)) for run in found), _OUTCOME))
    # Names of folders go into other commands: what has to give way are recipe and names.
    longest = max(len(run.folder.name) for run in found)
    table.add_column("run", overflow="fold", width=min(max(longest, _COMMENT), _FOLDER))
    for run in found:
        table.add_row(
            run.started[:16].replace("T", " "),
            Text(run.recipe),
            *(Text(getattr(run, key) or "-") for key in named),
            Text(_outcome(run), _STYLES.get(run.outcome, "")),
            Text(run.folder.name + (f"\n{run.comment}" if run.comment else "")),
        )
    return table


def _outcome(run: ListedRun) -> str:
    """How the run ended, how far it got, and its verdict by the recipe's limits."""
    words = run.outcome
    if run.outcome not in ("completed", "running", "unreadable") and run.of is not None:
        words += f", {run.done} of {run.of} {run.unit}s"
    if run.verdict is not None:
        words += f", limits: {run.verdict}"
    return words
