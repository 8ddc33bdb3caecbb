"""`stagectl paper`: reproduction of the source paper's simulation, tables and claims."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import console_for, progress_bar
from stagectl.cli.file_kinds import PAGE
from stagectl.cli.files import Output
from stagectl.cli.options import JSON_OUT, is_json_on_stdout, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from stagectl.paper import Case, Study


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
    from stagectl.paper import fixed_force, page, study, tables

    console = console_for(json_out)
    with progress_bar(console, "simulating") as update:
        try:
            found = study.run(_case(chosen), quick, partial(update, "simulating"))
        except ValueError as error:
            raise UnusableInput(f"paper: {error}") from error
    if json_out is not None:
        write_json(
            {
                "tables": tables.as_json(found.tables),
                "fixed_force": fixed_force.fixed_as_json(found.fixed),
                "claims": [
                    {"claim": c.claim, "verdict": c.verdict, "figure": c.figure}
                    for c in found.claims
                ],
            },
            json_out,
        )
    if out is not None:
        page.write(found, out)
    if not is_json_on_stdout(json_out):
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
        options=Options(initial=chosen["initial"], bounds=chosen["bounds"]),
    )


def _show(found: Study, console: Console) -> None:
    from rich.table import Table

    from stagectl.paper import page

    console.print(_estimates(found))
    console.print(_fixed(found))
    judged = Table(title="Claims of the paper", title_justify="left", show_lines=True)
    for name in ("claim", "verdict", "figure"):
        judged.add_column(name, overflow="fold", ratio=2 if name == "figure" else 1)
    for claim in found.claims:
        judged.add_row(claim.claim, claim.verdict, claim.figure)
    console.print(judged)
    if not found.sensitivity:
        return
    varied = Table(
        title="Two windows, errors in %, one choice changed (aligned unless stated)",
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


def _fixed(found: Study) -> Any:
    """Zone A's initial force fixed: estimates without their deviations, to fit a terminal."""
    from rich.table import Table

    from stagectl.paper import page

    table = Table(
        title="Zone A's initial force fixed (sigma0 in kN/m)", title_justify="left", padding=(0, 0)
    )
    for name in ("steps", "begins at", "force", "", "Fc", "C", "sigma_v", "sigma0", "eval."):
        table.add_column(name, justify="left" if name in ("steps", "begins at", "force", "")
                         else "right")  # fmt: skip
    for row in page.fixed_rows(found):
        steps, begins, force, windows, *pairs, _, _, evaluations, _ = row
        table.add_row(
            steps, begins.split(" ")[0], force, windows.split(" ")[0],
            *(pair.split(" ")[0] for pair in pairs), evaluations,
        )  # fmt: skip
    return table


def _estimates(found: Study) -> Any:
    """One row per parameter and method, to fit a terminal."""
    from rich.table import Table

    from stagectl.paper import page

    table = Table(title="Tables I and II", title_justify="left")
    for name in ("", "windows", "paper", "logged", "aligned"):
        table.add_column(name, justify="left" if name in ("", "windows") else "right", no_wrap=True)
    for row in page.table_rows(found):
        name, _, _, *columns = row
        for k, method in enumerate(("one", "two")):
            table.add_row(name if k == 0 else "", method, *columns[k::2], end_section=k == 1)
    return table
