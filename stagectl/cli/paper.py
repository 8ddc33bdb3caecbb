"""`stagectl paper`: the source paper's simulation, its tables and its claims."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import JSON_FILE, OUTPUT, quietly, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from stagectl.paper import Case, Study


@click.command(short_help="The source paper's tables and claims, reproduced.")
@click.option("--json", "json_out", type=JSON_FILE, help="Write the figures here; - is stdout.")
@click.option("--out", type=OUTPUT, help="Write a page (.md) and its plots into images/ by it.")
@click.option("--quick", is_flag=True, help="Fewer noisy runs, no sensitivity.")
@click.option("--rate", default=20_000, show_default=True, help="Samples per second.")
@click.option(
    "--cut-off", default=500.0, show_default=True, help="Of the low-pass filter [Hz]; 0: none."
)
@click.option(
    "--profile",
    type=click.Choice(["sine", "jerk-limited"]),
    default="sine",
    show_default=True,
    help="Of the demand.",
)
@click.option(
    "--bandwidth", default=100.0, show_default=True, help="Of the position loop, -3 dB [Hz]."
)
@click.option("--feedforward", is_flag=True, help="Add mass times demanded acceleration.")
@click.option(
    "--initial",
    type=click.Choice(["tied", "free"]),
    default="tied",
    show_default=True,
    help="Element forces where a zone begins: known from the model, or estimated.",
)
def command(json_out: Path | None, out: Path | None, quick: bool, **chosen: Any) -> None:
    """Simulate section IV of the source paper and check its tables and claims.

    25 mm, 16 friction elements in the plant and 4 in the model, no noise, one window against two,
    with the force as logged and aligned with the position. What the paper leaves open is an option.
    """
    from rich.console import Console
    from rich.progress import Progress

    from stagectl.errors import UnusableInput
    from stagectl.paper import page, study, tables

    quiet = quietly(json_out)
    console = Console(stderr=quiet)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("simulating", total=None)
        try:
            found = study.run(
                _case(chosen),
                quick,
                lambda done, total: bar.update(task, completed=done, total=total),
            )
        except ValueError as error:
            raise UnusableInput(f"paper: {error}") from error
    if json_out is not None:
        write_json(
            {
                "tables": tables.as_json(found.tables),
                "claims": [
                    {"claim": c.claim, "verdict": c.verdict, "figure": c.figure}
                    for c in found.claims
                ],
            },
            json_out,
        )
    if out is not None:
        page.write(found, out)
    if not quiet:
        _show(found, console)
        if out is not None:
            console.print(f"page: {out}")


def _case(chosen: dict[str, Any]) -> Case:
    from stagectl.paper import Case, Options, Processing, Setup

    return Case(
        Setup(
            rate=chosen["rate"],
            profile=chosen["profile"],
            bandwidth=chosen["bandwidth"],
            feedforward=chosen["feedforward"],
        ),
        Processing(cut_off=chosen["cut_off"] or None),
        options=Options(initial=chosen["initial"]),
    )


def _show(found: Study, console: Console) -> None:
    from rich.table import Table

    from stagectl.paper import page

    console.print(_estimates(found))
    judged = Table(title="Claims of the paper", title_justify="left", show_lines=True)
    for name in ("claim", "verdict", "figure"):
        judged.add_column(name, overflow="fold", ratio=2 if name == "figure" else 1)
    for claim in found.claims:
        judged.add_row(claim.claim, claim.verdict, claim.figure)
    console.print(judged)
    if not found.sensitivity:
        return
    varied = Table(
        title="Two windows, errors in %, one choice changed (aligned unless said)",
        title_justify="left",
    )
    for name in ("choice", "", "Fc", "C", "sigma_v", "sigma0"):
        varied.add_column(name, justify="left" if name in ("choice", "") else "right")
    last = ""
    for row in found.sensitivity:
        errors = page.errors(row)
        varied.add_row(row.group if row.group != last else "", row.choice, *errors)
        last = row.group
    console.print(varied)


def _estimates(found: Study) -> Any:
    """One row per parameter and method, so that it fits a terminal."""
    from rich.markup import escape
    from rich.table import Table

    from stagectl.paper import page

    table = Table(title="Tables I and II", title_justify="left")
    for name in ("", "windows", "paper", "logged", "aligned"):
        table.add_column(name, justify="left" if name in ("", "windows") else "right", no_wrap=True)
    for row in page.table_rows(found):
        name, _, _, *columns = row
        for k, method in enumerate(("one", "two")):
            table.add_row(
                escape(name) if k == 0 else "", method, *columns[k::2], end_section=k == 1
            )
    return table
