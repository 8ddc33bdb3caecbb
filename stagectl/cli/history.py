"""`stagectl history`: the friction history, and its maintenance."""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.files import HistoryFile
from stagectl.cli.history_access import HistoryOptions, has_estimates
from stagectl.cli.lazy import LazyGroup
from stagectl.cli.options import FILE, JSON_OUT, UtcTime, option, takes, write_json
from stagectl.cli.terminal import console_for, make_table
from stagectl.errors import UnusableInput

if TYPE_CHECKING:
    from rich.table import Table

    from stagectl.history import AxisFriction, RunFriction, StageKey

COMMANDS = {
    "list": ("stagectl.cli.history:list_runs", "List runs and the friction they have shown."),
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
    from stagectl.history import file_run, open_history, runs_in

    for noted in runs_in(run):
        where = history or noted.where
        if where is None:
            raise UnusableInput(f"{run}: was made without a history; name one with --history")
        with closing(open_history(where, write=True)) as opened:
            added = file_run(opened, noted)
        total = len(noted.estimates)
        click.echo(
            f"{added} of {total} estimates imported into {opened.name}"
            if added
            else f"all {total} estimates are already in {opened.name}"
        )


@dataclass(frozen=True)
class _Filter:
    """Which runs; fields as in `RunFilter`."""

    recipe: str | None = option("Only runs of this recipe.", metavar="NAME")
    lot: str | None = option("Only runs of this lot.", metavar="NAME")
    wafer: str | None = option("Only runs of this wafer.", metavar="NAME")
    purpose: str | None = option(
        "Only runs of this kind.", click.Choice(["production", "calibration"])
    )
    since: float = option(
        "Only runs begun at this date or later, UTC.", UtcTime(), -math.inf, show_default=False
    )
    until: float = option(
        "Only runs begun at this date or before, UTC.", UtcTime(), math.inf, show_default=False
    )
    last: int = option("At most so many runs.", click.IntRange(1), 20)


@click.command("list")
@takes(HistoryOptions)
@takes(_Filter)
@JSON_OUT
def list_runs(histories: HistoryOptions, wanted: _Filter, json_out: Path | None) -> None:
    """List the runs of a stage in its history, newest last, with the friction they have shown.

    Fc is the Coulomb force (± 1 sigma) that a run has accepted last, as it stands at the end of the
    run in its summary. Accepted: estimates accepted, of all.
    """
    from stagectl.history import RunFilter
    from stagectl.report import Whole

    with histories.open(has=has_estimates) as (opened, stage):
        found = opened.friction_of_runs(stage, RunFilter(**asdict(wanted)))[::-1]
    write_json(_as_dict(stage, found), json_out)
    console = console_for(json_out)
    if found:
        console.print(Whole(_table(stage, found)), crop=False)
    else:
        console.print(f"no such runs of {stage}")


def _as_dict(stage: StageKey, found: list[RunFriction]) -> dict[str, Any]:
    return {
        "format": "stagectl-history-runs", "version": 1, "machine": stage.machine,
        "simulated": stage.simulated,
        "runs": [
            {
                "run": one.number, "started": one.entry.started, "purpose": one.entry.purpose,
                "recipe": one.entry.recipe, "lot": one.entry.lot, "wafer": one.entry.wafer,
                "outcome": one.outcome, "folder": one.entry.folder,
                "axes": {
                    name: {"estimates": of.estimates, "accepted": of.accepted,
                           "coulomb": of.coulomb, "sigma": of.sigma}
                    for name, of in one.axes.items()
                },
            }
            for one in found
        ],
    }  # fmt: skip


def _table(stage: StageKey, found: list[RunFriction]) -> Table:
    """A row per run; lot and wafer have a column where any run names one."""
    from rich import box
    from rich.text import Text

    axes = found[0].entry.axes
    named = [key for key in ("lot", "wafer") if any(getattr(r.entry, key) for r in found)]
    forces = [f"Fc {axis}, N" for axis in axes]
    rows = []
    for run in found:
        of = run.axes
        started = f"{datetime.fromtimestamp(run.entry.started, UTC):%Y-%m-%d %H:%M}"
        names = (getattr(run.entry, key) or "-" for key in named)
        accepted = (
            f"{sum(a.accepted for a in of.values())} of {sum(a.estimates for a in of.values())}"
        )
        row = [started, run.entry.recipe, *names, run.outcome or "unknown"]
        rows.append([*row, *(_force(of.get(axis)) for axis in axes), accepted])
    titles = ("started (UTC)", "recipe", *named, "outcome", *forces, "accepted")
    look = {"box": box.SIMPLE_HEAD, "padding": (0, 1, 0, 0)}
    return make_table(Text(f"runs of {stage}"), titles, rows, (*forces, "accepted"), **look)


def _force(found: AxisFriction | None) -> str:
    """With its standard deviation."""
    if found is None or found.coulomb is None or found.sigma is None:
        return "-"
    return f"{found.coulomb:.3f} ± {found.sigma:.2g}"
