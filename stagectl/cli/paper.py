"""`stagectl paper`: reproduction of the source paper's simulation, tables and claims."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from stagectl.cli.file_kinds import PAGE
from stagectl.cli.files import Output
from stagectl.cli.options import JSON_OUT, is_json_on_stdout, option, takes, write_json
from stagectl.cli.terminal import console_for, make_table, progress_bar
from stagectl.errors import unusable

if TYPE_CHECKING:
    from rich.console import Console

    from stagectl.paper import Study


@dataclass(frozen=True)
class _CaseOptions:
    """What the paper does not specify."""

    rate: int = option("Sampling rate [Hz].", default=20_000)
    cut_off: float = option("Cut-off of the low-pass filter [Hz]; 0: none.", default=500.0)
    profile: Literal["sine", "jerk-limited"] = option(
        "Motion profile of the setpoints.", click.Choice(["sine", "jerk-limited"]), "sine"
    )
    bandwidth: float = option("-3 dB bandwidth of the position loop [Hz].", default=100.0)
    feedforward: bool = option("Add acceleration feedforward.", default=False)
    initial: Literal["tied", "reference", "measured", "free"] = option(
        "Element forces where zone A begins: the model's slip force, that of the reference "
        "values, measured, or estimated (in zone B, too).",
        click.Choice(["tied", "reference", "measured", "free"]),
        "tied",
    )
    bounds: Literal["bounded", "shortened"] = option(
        "Steps: the minimiser within p >= 0, or Gauss-Newton steps halved until they stay within.",
        click.Choice(["bounded", "shortened"]),
        "bounded",
    )


@click.command
@JSON_OUT
@click.option(
    "--out", type=Output(PAGE), help="Write a Markdown page, and its plots to images/ next to it."
)
@click.option("--quick", is_flag=True, help="Fewer noisy runs, no sensitivity study.")
@takes(_CaseOptions)
def command(given: _CaseOptions, json_out: Path | None, out: Path | None, quick: bool) -> None:
    """Simulate section IV of the source paper and check its tables and claims.

    A move of 25 mm, 16 friction elements in the plant and 4 in the model, no noise. One window is
    compared with two, with the force as logged and aligned with the position. Whatever the paper
    does not specify is an option.
    """
    from functools import partial

    from stagectl.paper import Case, page, study, tables

    console = console_for(json_out)
    with progress_bar(console, "simulating") as update, unusable(ValueError, about="paper: "):
        case = Case(**{**asdict(given), "cut_off": given.cut_off or None})
        found = study.run(case, quick, partial(update, "simulating"))
    if json_out is not None:
        write_json(
            {
                "tables": tables.as_json(found.tables),
                "fixed_force": [
                    {"initial": initial, "bounds": bounds, "tables": tables.as_json(fixed)}
                    for (bounds, initial), fixed in found.fixed.items()
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
    from stagectl.paper import page

    for each in page.tables(found):
        console.print(make_table(*each, padding=(0, 0)))
    for number, claim in enumerate(found.claims, 1):
        console.print(f"\n{number}. {claim.claim}\n   {claim.verdict}. {claim.figure}")
