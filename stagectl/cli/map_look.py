"""`stagectl map`: what can be seen of maps: `show`, `history`, `compare`, `export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.history_access import chosen, history_options, open_for, versions_of
from stagectl.cli.options import JSON_OUT, OUTPUT, NumberRange, quietly, write_json

if TYPE_CHECKING:
    from stagectl.maps import MapVersion


@click.command("show", short_help="A version: its figures, sites, and an HTML page.")
@click.argument("number", type=int, required=False)
@history_options
@click.option("--html", type=OUTPUT, help="Write heat maps, trends and changes here.")
@click.option("--at", nargs=2, type=float, metavar="X Y", help="Also the value at this place [m].")
@JSON_OUT
def show(
    number: int | None, history: str | None, stage_name: str | None, simulated: bool | None,
    html: Path | None, at: tuple[float, float] | None, json_out: Path | None,
) -> None:  # fmt: skip
    """Version NUMBER [the active one, else the last]."""
    from math import isfinite

    from rich.console import Console

    from stagectl.maps import at_place, shown, summary

    if at is not None and not all(map(isfinite, at)):
        raise click.BadParameter("must be two finite numbers, in m", param_hint="--at")

    opened, stage = open_for(history, stage_name, simulated)
    try:
        versions = versions_of(opened, stage)
        version = chosen(versions, number, opened.name)
        console = Console(stderr=quietly(json_out))
        console.print(summary(version), crop=False)
        if at is not None:
            console.print(at_place(version, at), crop=False)
        if html is not None:
            from stagectl.maps import write_map_report

            write_map_report(html, opened, stage, version, _before(versions, version))
            click.echo(f"written: {html}", err=quietly(json_out))
        if json_out is not None:
            write_json(shown(version, at), json_out)
    finally:
        opened.close()


@click.command("history", short_help="All versions, and when which was in use.")
@history_options
@JSON_OUT
def list_versions(
    history: str | None, stage_name: str | None, simulated: bool | None, json_out: Path | None
) -> None:
    """All versions and their use."""
    from rich.console import Console

    from stagectl.maps import listed, versions_table

    opened, stage = open_for(history, stage_name, simulated)
    try:
        versions, used = versions_of(opened, stage), opened.activations(stage)
    finally:
        opened.close()
    Console(stderr=quietly(json_out)).print(versions_table(stage, versions, used), crop=False)
    if json_out is not None:
        write_json(listed(stage, versions, used), json_out)


@click.command("compare", short_help="What has changed from one version to another.")
@click.argument("old", type=int)
@click.argument("new", type=int)
@history_options
@JSON_OUT
def compare(
    old: int, new: int, history: str | None, stage_name: str | None, simulated: bool | None,
    json_out: Path | None,
) -> None:  # fmt: skip
    """What has changed from version OLD to version NEW."""
    from rich.console import Console

    from stagectl.maps import changed, changes_table
    from stagectl.maps import compare as changes

    opened, stage = open_for(history, stage_name, simulated)
    try:
        versions = versions_of(opened, stage)
        first = chosen(versions, old, opened.name)
        second = chosen(versions, new, opened.name)
    finally:
        opened.close()
    found = changes(first.map, second.map)
    Console(stderr=quietly(json_out)).print(changes_table(old, new, found), crop=False)
    if json_out is not None:
        write_json(changed(stage, old, new, found), json_out)


@click.command("export", short_help="A version as CSV or Parquet.")
@click.argument("out", type=OUTPUT)
@click.option("--number", type=int, help="Version [the active one, else the last].")
@click.option(
    "--what",
    type=click.Choice(["sites", "grid", "estimates", "refused"]),
    default="sites",
    show_default=True,
    help="The map's sites, its field on a grid, or the history: every accepted estimate, or every "
    "refused one with the reason.",
)
@click.option("--step", type=NumberRange(1e-5, 1.0), default=5e-3, show_default=True,
              help="Of the grid [m].")  # fmt: skip
@history_options
def export(
    out: Path, number: int | None, what: str, step: float, history: str | None,
    stage_name: str | None, simulated: bool | None,
) -> None:  # fmt: skip
    """Write OUT, whose ending says how: .csv, or .parquet (needs pyarrow)."""
    from stagectl.maps import export as tables

    opened, stage = open_for(history, stage_name, simulated)
    try:
        if what in ("estimates", "refused"):
            whole = tables.trend_table if what == "estimates" else tables.refused_table
            table = whole(opened, stage)
        else:
            version = chosen(versions_of(opened, stage), number, opened.name)
            table = (
                tables.sites_table(version) if what == "sites"
                else tables.grid_table(version, step)
            )  # fmt: skip
    finally:
        opened.close()
    tables.write_table(table, out)
    click.echo(f"{len(table.rows)} rows in {out}")


def _before(versions: list[MapVersion], version: MapVersion) -> MapVersion | None:
    older = [v for v in versions if v.number < version.number]
    return older[-1] if older else None
