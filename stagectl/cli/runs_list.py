"""`stagectl runs [list]`: the runs in a folder."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.console import make_console
from stagectl.cli.files import InputFolder
from stagectl.cli.options import JSON_OUT, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from rich.console import RenderableType

    from stagectl.report.outline import Level
    from stagectl.run import ListedRun

_LEVELS: dict[str, Level] = {
    "completed": "good", "aborted": "warning", "fault": "bad", "killed": "bad"
}  # fmt: skip
_NAMES = ("lot", "wafer", "operator", "comment")


@click.command("list")
@click.argument("folder", type=InputFolder(), default=Path("runs"))
@click.option("--lot", metavar="NAME", help="Only runs of this lot.")
@click.option("--since", type=click.DateTime(), help="Only runs begun at this date or later, UTC.")
@click.option("--failed", is_flag=True, help="Only runs that ended early or miss their limits.")
@JSON_OUT
def command(
    folder: Path, lot: str | None, since: datetime | None, failed: bool, json_out: Path | None
) -> None:
    """List the runs in FOLDER [runs], oldest first: when, what, on which wafer, by whom, outcome.

    Settling is the median of the micro-moves to the tightest window, in ms. A killed run is listed
    with what it recorded ('stagectl recover' makes its recording); one in progress is `running`. A
    run that continues another names its folder. With --json also the progress of each run.
    """
    from stagectl.run import list_runs

    found = [
        run
        for run in list_runs(folder)
        if (lot is None or run.lot == lot)
        and (since is None or _is_since(run, since))
        and (not failed or _has_failed(run))
    ]
    values = [{**asdict(run), "folder": str(run.folder)} for run in found]
    write_json({"format": "stagectl-runs", "version": 1, "runs": values}, json_out)
    if not is_json_on_stdout(json_out):
        nothing = f"no such runs in {folder}"
        make_console().print(_table(found) if found else nothing, crop=False)


def _is_since(run: ListedRun, since: datetime) -> bool:
    try:
        return datetime.fromisoformat(run.started) >= since.replace(tzinfo=UTC)
    except (ValueError, TypeError):  # without a date, or a zone
        return False


def _has_failed(run: ListedRun) -> bool:
    return run.outcome not in ("completed", "running") or run.verdict == "fail"


def _table(found: list[ListedRun]) -> RenderableType:
    """A row per run, whole; what no run names has no column."""
    from stagectl.report import Fact, Table, Whole, print_table
    from stagectl.report.formats import milliseconds

    named = [key for key in _NAMES if any(getattr(run, key) for run in found)]
    resumed = any(run.continues for run in found)
    rows = []
    for run in found:
        stage = {True: "virtual", False: "real", None: ""}[run.simulated]
        names = [getattr(run, key) or "-" for key in named]
        outcome = Fact(_outcome(run), _LEVELS.get(run.outcome, ""))
        row = [run.started[:16].replace("T", " "), run.recipe, stage, *names, outcome]
        row += [milliseconds(run.settling), str(run.folder)]
        rows.append([*row, *([run.continues or ""] if resumed else [])])
    titles = ["started", "recipe", "stage", *named, "outcome", "settling", "run"]
    titles += ["continues"] if resumed else []
    return Whole(print_table(Table(titles, rows)))


def _outcome(run: ListedRun) -> str:
    """How the run ended, how far it got, and its verdict by the recipe's limits."""
    words = run.outcome
    if run.outcome not in ("completed", "running", "unreadable") and run.of is not None:
        words += f", {run.done} of {run.of} {run.unit}s"
    if run.verdict is not None:
        words += f", limits: {run.verdict}"
    return words
