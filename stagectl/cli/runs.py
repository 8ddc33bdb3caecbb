"""`stagectl runs`: the runs in a folder, listed or compared."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.files import InputFolder
from stagectl.cli.lazy import LazyGroup
from stagectl.cli.options import JSON_OUT, UtcTime
from stagectl.cli.terminal import make_console, show_result
from stagectl.errors import UnusableInput

if TYPE_CHECKING:
    from rich.console import RenderableType

    from stagectl.report import Cell
    from stagectl.report.outline import Level
    from stagectl.run import ListedRun

COMMANDS = {
    "list": ("stagectl.cli.runs:list_", "List the runs in a folder; what `runs FOLDER` does, too."),
    "compare": ("stagectl.cli.runs:compare", "Two runs beside each other."),
}
_LEVELS: dict[str, Level] = {
    "completed": "good", "aborted": "warning", "fault": "bad", "killed": "bad"
}  # fmt: skip
_NAMES = ("lot", "wafer", "operator", "comment")


class _RunsGroup(LazyGroup):
    """Lists where no command is named."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or args[0] not in (*COMMANDS, "--help"):
            args = ["list", *args]
        return super().parse_args(ctx, args)


@click.group(cls=_RunsGroup, lazy=COMMANDS)
def command() -> None:
    """List the runs in a folder, or compare two.

    \b
    What has been run, and how did it end?
      stagectl runs [FOLDER]
    How do two wafers differ?
      stagectl runs compare runs/A runs/B
    """  # noqa: D301  (\b keeps click from wrapping what follows)


@click.command("list")
@click.argument("folder", type=InputFolder(), default=Path("runs"))
@click.option("--lot", metavar="NAME", help="Only runs of this lot.")
@click.option("--since", type=UtcTime(), help="Only runs begun at this date or later, UTC.")
@click.option("--failed", is_flag=True, help="Only runs that ended early or miss their limits.")
@JSON_OUT
def list_(
    folder: Path, lot: str | None, since: float | None, failed: bool, json_out: Path | None
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
    shown = _table(found) if found else f"no such runs in {folder}"
    show_result({"format": "stagectl-runs", "version": 1, "runs": values}, json_out, shown)


def _is_since(run: ListedRun, since: float) -> bool:
    try:
        begun = datetime.fromisoformat(run.started)
    except ValueError:
        return False
    return begun.tzinfo is not None and begun.timestamp() >= since


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


@click.command("compare")
@click.argument("first", type=InputFolder(), metavar="A")
@click.argument("second", type=InputFolder(), metavar="B")
def compare(first: Path, second: Path) -> None:
    """Compare two runs, such as those of two wafers: settling, peak errors, friction, limits.

    A and B are folders of runs. Values are those of their reports: medians of the moves of each
    axis and kind, and the friction figures accepted last.
    """
    from stagectl.report import Section, Table, print_sections
    from stagectl.report.formats import DASH

    a, b = (_figures(_summary(folder)) for folder in (first, second))
    rows = [(what, a.get(what, DASH), b.get(what, DASH)) for what in dict.fromkeys([*a, *b])]
    table = Table(("", first.name, second.name), rows)
    section = Section(f"{first.name} and {second.name}", table=table)
    make_console().print(print_sections([section]), crop=False)


def _summary(folder: Path) -> Mapping[str, Any]:
    """A run's summary.

    Raises:
        UnusableInput: there is none.
    """
    path = folder / "summary.json"
    try:
        summary: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UnusableInput(f"{path}: no summary of a run ({error})") from None
    if summary.get("format") != "stagectl-run-summary":
        raise UnusableInput(f"{path}: no summary of a run")
    return summary


def _figures(summary: Mapping[str, Any]) -> dict[str, str]:
    """What a run says, by its subject."""
    from stagectl.report import run_outline
    from stagectl.report.formats import DASH

    outline = run_outline(summary, None)
    found = {"Outcome": ". ".join(badge.text for badge in outline.badges)}
    for key in ("Stage", "Friction map", "Lot", "Wafer"):
        found[key] = outline.facts.get(key) or DASH
    moves, friction = (outline.sections[name].table for name in ("results", "friction"))
    if moves is not None:
        for axis, kind, _, *cells in moves.rows:
            for title, cell in zip(moves.titles[3:], cells, strict=True):
                if title not in moves.on_page:
                    found[f"{_text(axis)} {_text(kind)}: {title}"] = _text(cell)
    if friction is not None:
        for axis, name, value, sigma, unit, _ in friction.rows:
            what = f"{_text(axis)} {_text(name)}, {_text(unit)}"
            found[what] = f"{_text(value)} ± {_text(sigma)}"
    return found


def _text(cell: Cell) -> str:
    return cell if isinstance(cell, str) else cell.text
