"""`stagectl history list`: the runs of a history, and the friction that they have shown."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import console_for
from stagectl.cli.history_access import OpenHistory, has_estimates, history_options
from stagectl.cli.options import JSON_OUT, write_json

if TYPE_CHECKING:
    from rich.table import Table

    from stagectl.history import AxisFriction, RunFriction, StageKey


@click.command("list")
@history_options
@click.option("--recipe", metavar="NAME", help="Only runs of this recipe.")
@click.option("--lot", metavar="NAME", help="Only runs of this lot.")
@click.option("--wafer", metavar="NAME", help="Only runs of this wafer.")
@click.option(
    "--purpose", type=click.Choice(["production", "calibration"]), help="Only runs of this kind."
)
@click.option("--since", type=click.DateTime(), help="Only runs begun at this date or later, UTC.")
@click.option("--until", type=click.DateTime(), help="Only runs begun at this date or before, UTC.")
@click.option(
    "--last", type=click.IntRange(1), default=20, show_default=True, help="At most so many runs."
)
@JSON_OUT
def list_runs(
    open_history: OpenHistory, recipe: str | None, lot: str | None, wafer: str | None,
    purpose: str | None, since: datetime | None, until: datetime | None, last: int,
    json_out: Path | None,
) -> None:  # fmt: skip
    """List the runs of a stage in its history, newest last, with the friction they have shown.

    Fc is the Coulomb force (± 1 sigma) that a run has accepted last, as it stands at the end of the
    run in its summary. Accepted: estimates accepted, of all.
    """
    from stagectl.history import RunFilter
    from stagectl.report import Whole

    def timestamp(value: datetime | None, default: float) -> float:
        return default if value is None else value.replace(tzinfo=UTC).timestamp()

    begin, end = timestamp(since, float("-inf")), timestamp(until, float("inf"))
    wanted = RunFilter(recipe, lot, wafer, purpose, begin, end, last)
    with open_history(has=has_estimates) as (opened, stage):
        found = opened.friction_of_runs(stage, wanted)[::-1]
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
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(f"runs of {stage}"), title_justify="left", box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )  # fmt: skip
    axes = found[0].entry.axes
    named = [key for key in ("lot", "wafer") if any(getattr(r.entry, key) for r in found)]
    for title in ("started (UTC)", "recipe", *named, "outcome"):
        table.add_column(title)
    for axis in axes:
        table.add_column(Text(f"Fc {axis}, N"), justify="right")
    table.add_column("accepted", justify="right")
    for run in found:
        of = run.axes
        table.add_row(
            f"{datetime.fromtimestamp(run.entry.started, UTC):%Y-%m-%d %H:%M}",
            Text(run.entry.recipe),
            *(Text(getattr(run.entry, key) or "-") for key in named),
            Text(run.outcome or "unknown"),
            *(_force(of.get(axis)) for axis in axes),
            f"{sum(a.accepted for a in of.values())} of {sum(a.estimates for a in of.values())}",
        )
    return table


def _force(found: AxisFriction | None) -> str:
    """With its standard deviation."""
    if found is None or found.coulomb is None or found.sigma is None:
        return "-"
    return f"{found.coulomb:.3f} ± {found.sigma:.2g}"
