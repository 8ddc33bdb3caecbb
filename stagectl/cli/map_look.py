"""`stagectl map show`, `history`, `compare` and `export`: reading friction maps."""

from __future__ import annotations

from pathlib import Path

import click

from stagectl.cli.file_kinds import HTML, TABLE
from stagectl.cli.files import Output
from stagectl.cli.history_access import (
    HistoryOptions,
    has_estimates,
    has_maps,
    select_version,
)
from stagectl.cli.options import (
    JSON_OUT,
    NumberRange,
    Quantity,
    is_json_on_stdout,
    takes,
    write_json,
)
from stagectl.cli.terminal import console_for


@click.command("show")
@click.argument("number", type=int, required=False)
@takes(HistoryOptions)
@click.option(
    "--html", type=Output(HTML), help="Write heat maps, trends and changes as an HTML page."
)
@click.option(
    "--at",
    nargs=2,
    type=Quantity("LENGTH"),
    metavar="X Y",
    help="Also print the map's value at this place, in m or with a unit: 10mm -5mm.",
)
@JSON_OUT
def show(
    histories: HistoryOptions, number: int | None, html: Path | None,
    at: tuple[float, float] | None, json_out: Path | None,
) -> None:  # fmt: skip
    """Print the friction parameters and sites of version NUMBER.

    Without NUMBER: the version in use, or the latest if none is.
    """
    from stagectl.maps import map_versions
    from stagectl.maps.output import at_place, map_outline, version_as_json, write_map_page
    from stagectl.report import print_outline, print_sections

    with histories.open() as (opened, stage):
        version = select_version(opened, stage, number)
        older = [v for v in map_versions(opened, stage) if v.number < version.number]
        before = older[-1] if older else None
        more = () if at is None else (print_sections([at_place(version, at)]),)
        outline = map_outline(opened, stage, version, before)
        console_for(json_out).print(print_outline(outline, *more), crop=False)
        if html is not None:
            write_map_page(html, opened, stage, version, before)
            click.echo(f"written: {html}", err=is_json_on_stdout(json_out))
        write_json(version_as_json(version, at), json_out)


@click.command("history")
@takes(HistoryOptions)
@JSON_OUT
def list_versions(histories: HistoryOptions, json_out: Path | None) -> None:
    """List all versions, and when each was in use."""
    from stagectl.maps import map_versions
    from stagectl.maps.output import versions_as_json, versions_sections
    from stagectl.report import print_sections

    with histories.open() as (opened, stage):
        versions, used = map_versions(opened, stage), opened.activations(stage)
    sections = versions_sections(stage, versions, used)
    console_for(json_out).print(print_sections(sections), crop=False)
    write_json(versions_as_json(stage, versions, used), json_out)


@click.command("compare")
@click.argument("old", type=int)
@click.argument("new", type=int)
@takes(HistoryOptions)
@JSON_OUT
def compare(histories: HistoryOptions, old: int, new: int, json_out: Path | None) -> None:
    """Show what changed from version OLD to version NEW, site by site."""
    from stagectl.maps import compare as compare_maps
    from stagectl.maps.output import changes_as_json, changes_sections
    from stagectl.report import print_sections

    with histories.open() as (opened, stage):
        first = select_version(opened, stage, old)
        second = select_version(opened, stage, new)
    changes = compare_maps(first.map, second.map)
    sections = changes_sections(old, changes)
    if not sections:
        click.echo("the two maps have no axis in common", err=is_json_on_stdout(json_out))
    console_for(json_out).print(print_sections(sections.values()), crop=False)
    write_json(changes_as_json(stage, old, new, changes), json_out)


@click.command("export")
@click.argument("out", type=Output(TABLE))
@click.option("--number", type=int, help="Version.  [default: the one in use, else the latest]")
@click.option(
    "--what",
    type=click.Choice(["sites", "grid", "estimates", "refused"]),
    default="sites",
    help="The map's sites; the map on a grid; or, from the history, every accepted estimate or "
    "every refused one with the reason.",
)
@click.option("--step", type=NumberRange(1e-5, 1.0), default=5e-3,
              help="Grid spacing [m].")  # fmt: skip
@takes(HistoryOptions)
def export(
    histories: HistoryOptions, out: Path, number: int | None, what: str, step: float
) -> None:
    """Write a table to OUT: .csv, or .parquet (needs pyarrow)."""
    from stagectl.maps.output import export as tables

    needed = has_estimates if what in ("estimates", "refused") else has_maps
    with histories.open(has=needed) as (opened, stage):
        if what == "estimates":
            table = tables.trend_table(opened, stage)
        elif what == "refused":
            table = tables.refused_table(opened, stage)
        else:
            version = select_version(opened, stage, number)
            table = (
                tables.sites_table(version) if what == "sites"
                else tables.grid_table(version, step)
            )  # fmt: skip
    tables.write_table(table, out)
    click.echo(f"{len(table.rows)} rows in {out}")
