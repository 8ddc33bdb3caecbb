"""`stagectl paper`: reproduction of the source paper's simulation, tables and claims."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import console_for, progress_bar
from stagectl.cli.file_kinds import PAGE
from stagectl.cli.files import Output
from stagectl.cli.options import JSON_OUT, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from stagectl.paper import Study


@click.command
@JSON_OUT
@click.option(
    "--out", type=Output(PAGE), help="Write a Markdown page, and its plots to images/ next to it."
)
@click.option("--quick", is_flag=True, help="Fewer noisy runs, no sensitivity study.")
@click.option("--rate", default=20_000, show_default=True, help="Sampling rate [Hz].")
@click.option(
    "--cut-off",
    default=500.0,
    show_default=True,
    help="Cut-off of the low-pass filter [Hz]; 0: none.",
)
@click.option(
    "--profile",
    type=click.Choice(["sine", "jerk-limited"]),
    default="sine",
    show_default=True,
    help="Motion profile of the setpoints.",
)
@click.option(
    "--bandwidth",
    default=100.0,
    show_default=True,
    help="-3 dB bandwidth of the position loop [Hz].",
)
@click.option("--feedforward", is_flag=True, help="Add acceleration feedforward.")
@click.option(
    "--initial",
    type=click.Choice(["tied", "reference", "measured", "free"]),
    default="tied",
    show_default=True,
    help="Element forces where zone A begins: the model's slip force, that of the reference "
    "values, measured, or estimated (in zone B, too).",
)
@click.option(
    "--bounds",
    type=click.Choice(["bounded", "shortened"]),
    default="bounded",
    show_default=True,
    help="Steps: the minimiser within p >= 0, or Gauss-Newton steps halved until they stay within.",
)
def command(json_out: Path | None, out: Path | None, quick: bool, **chosen: Any) -> None:
    """Simulate section IV of the source paper and check its tables and claims.

    A move of 25 mm, 16 friction elements in the plant and 4 in the model, no noise. One window is
    compared with two, with the force as logged and aligned with the position. Whatever the paper
    does not specify is an option.
    """
    from functools import partial

    from stagectl.errors import UnusableInput
    from stagectl.paper import Case, Options, Processing, Setup, page, study, tables

    console = console_for(json_out)
    with progress_bar(console, "simulating") as update:
        try:
            case = Case(
                Setup(
                    **{
                        name: chosen[name]
                        for name in ("rate", "profile", "bandwidth", "feedforward")
                    }
                ),
                Processing(cut_off=chosen["cut_off"] or None),
                options=Options(initial=chosen["initial"], bounds=chosen["bounds"]),
            )
            found = study.run(case, quick, partial(update, "simulating"))
        except ValueError as error:
            raise UnusableInput(f"paper: {error}") from error
    if json_out is not None:
        write_json(
            {
                "tables": tables.as_json(found.tables),
                "fixed_force": [
                    {"initial": v.initial, "bounds": v.bounds, "tables": tables.as_json(v.tables)}
                    for v in found.fixed
                ],
                "claims": [asdict(claim) for claim in found.claims],
            },
            json_out,
        )
    if out is not None:
        page.write(found, out)
    if not is_json_on_stdout(json_out):
        _show(found, console)
        if out is not None:
            console.print(f"page: {out}")


def _show(found: Study, console: Console) -> None:
    from rich.table import Column, Table

    from stagectl.paper import page

    for each in page.tables(found):
        columns = (Column(name, overflow="fold") for name in each.head)
        table = Table(*columns, title=each.title, title_justify="left", padding=(0, 0))
        for row in each.rows:
            table.add_row(*row)
        console.print(table)
    for number, claim in enumerate(found.claims, 1):
        console.print(f"\n{number}. {claim.claim}\n   {claim.verdict}. {claim.figure}")
