"""`stagectl map`: friction over the table, in versions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.history_access import history_options, machine_of, open_for
from stagectl.cli.options import FILE, JSON_OUT, OUTPUT, NumberRange, quietly, write_json

if TYPE_CHECKING:
    from stagectl.history.port import History
    from stagectl.history.records import StageKey
    from stagectl.maps.model import MapVersion

MAX_AGE = 365.0
"""A map of so long ago [days] is not put into use without being asked for."""


@click.group(name="map")
def command() -> None:
    """Friction over the table: built from calibrations, kept in versions, used when activated.

    \b
    A map comes about and into use like this:
      stagectl calibrate SITES.yaml        # measures, and keeps a new version
      stagectl map show --html map.html    # look at it
      stagectl map activate                # runs go by it from now on
    """  # noqa: D301


@command.command(short_help="Make a new version out of the history.")
@history_options
@click.option("--date", type=click.DateTime(), help="As things stood then, UTC [now].")
@click.option("--since", type=click.DateTime(), help="Nothing earlier goes in, UTC.")
@click.option("--comment", default="", help="Kept with it.")
def build(
    history: str | None, stage_name: str | None, simulated: bool | None, date: object,
    since: object, comment: str,
) -> None:  # fmt: skip
    """Make a new version out of what is in the history; it is not put into use by this."""
    from datetime import UTC, datetime

    from stagectl.maps.build import build_map
    from stagectl.maps.model import to_json

    def seconds(value: object, default: float) -> float:
        return value.replace(tzinfo=UTC).timestamp() if isinstance(value, datetime) else default

    opened, stage = open_for(history, stage_name, simulated, write=True)
    try:
        built = build_map(opened, stage, seconds(date, float("inf")), seconds(since, float("-inf")))
        number = opened.save_map(stage, datetime.now(UTC).timestamp(), comment, to_json(built))
    finally:
        opened.close()
    sites = ", ".join(f"{name}: {len(axis.sites)} sites" for name, axis in built.axes.items())
    click.echo(
        f"map {number} of {stage} ({sites}); 'stagectl map activate {number}' puts it in use"
    )


@command.command(short_help="A version: its figures, sites, and an HTML page.")
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

    from stagectl.maps.plain import shown
    from stagectl.maps.tables import at_place, summary

    if at is not None and not all(map(isfinite, at)):
        raise click.BadParameter("must be two finite numbers, in m", param_hint="--at")

    opened, stage = open_for(history, stage_name, simulated)
    try:
        versions = _versions(opened, stage)
        version = _chosen(versions, number, opened.name)
        console = Console(stderr=quietly(json_out))
        console.print(summary(version), crop=False)
        if at is not None:
            console.print(at_place(version, at), crop=False)
        if html is not None:
            from stagectl.maps.report import write_map_report

            write_map_report(html, opened, stage, version, _before(versions, version))
            click.echo(f"written: {html}", err=quietly(json_out))
        if json_out is not None:
            write_json(shown(version, at), json_out)
    finally:
        opened.close()


@command.command(name="history", short_help="All versions, and when which was in use.")
@history_options
@JSON_OUT
def list_versions(
    history: str | None, stage_name: str | None, simulated: bool | None, json_out: Path | None
) -> None:
    """All versions and their use."""
    from rich.console import Console

    from stagectl.maps.plain import listed
    from stagectl.maps.tables import versions_table

    opened, stage = open_for(history, stage_name, simulated)
    try:
        versions, used = _versions(opened, stage), opened.activations(stage)
    finally:
        opened.close()
    Console(stderr=quietly(json_out)).print(versions_table(stage, versions, used), crop=False)
    if json_out is not None:
        write_json(listed(stage, versions, used), json_out)


@command.command(short_help="Put a version into use, once it is known to fit.")
@click.argument("number", type=int, required=False)
@history_options
@click.option("--machine", type=FILE, help="Machine file that it has to fit [wafer-xy].")
@click.option("--check", is_flag=True, help="Only say whether it could be.")
@click.option("--max-age", type=NumberRange(0.0), default=MAX_AGE, show_default=True,
              help="An older one is refused [days].")  # fmt: skip
@JSON_OUT
def activate(
    number: int | None, history: str | None, stage_name: str | None, simulated: bool | None,
    machine: Path | None, check: bool, max_age: float, json_out: Path | None,
) -> None:  # fmt: skip
    """Put version NUMBER [the last] into use: runs on this history go by it from the next on."""
    opened, stage = open_for(history, stage_name, simulated, write=not check)
    try:
        version = _chosen(_versions(opened, stage), number, opened.name, last=True)
        _apply(opened, stage, version, machine, max_age, None if check else "activated", json_out)
    finally:
        opened.close()


@command.command(short_help="Back to the version that was in use before.")
@history_options
@click.option("--machine", type=FILE, help="Machine file that it has to fit [wafer-xy].")
@click.option("--max-age", type=NumberRange(0.0), default=MAX_AGE, show_default=True,
              help="An older one is refused [days].")  # fmt: skip
@JSON_OUT
def rollback(
    history: str | None, stage_name: str | None, simulated: bool | None, machine: Path | None,
    max_age: float, json_out: Path | None,
) -> None:  # fmt: skip
    """Put the version into use that was before the present one; none where there was none."""
    opened, stage = open_for(history, stage_name, simulated, write=True)
    try:
        before = _before_present(opened, stage)
        if before is None:
            from datetime import UTC, datetime

            from stagectl.maps.plain import applied

            opened.activate(stage, None, datetime.now(UTC).timestamp(), "rolled back")
            click.echo(f"{stage}: no map in use", err=quietly(json_out))
            if json_out is not None:
                write_json(applied(stage, None, [], "rolled back"), json_out)
            return
        version = _chosen(_versions(opened, stage), before, opened.name)
        _apply(opened, stage, version, machine, max_age, "rolled back", json_out)
    finally:
        opened.close()


@command.command(short_help="A version as CSV or Parquet.")
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
            version = _chosen(_versions(opened, stage), number, opened.name)
            table = (
                tables.sites_table(version) if what == "sites"
                else tables.grid_table(version, step)
            )  # fmt: skip
    finally:
        opened.close()
    tables.write_table(table, out)
    click.echo(f"{len(table.rows)} rows in {out}")


@command.command(short_help="What has changed from one version to another.")
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

    from stagectl.maps.compare import compare as changes
    from stagectl.maps.plain import changed
    from stagectl.maps.tables import changes_table

    opened, stage = open_for(history, stage_name, simulated)
    try:
        versions = _versions(opened, stage)
        first = _chosen(versions, old, opened.name)
        second = _chosen(versions, new, opened.name)
    finally:
        opened.close()
    found = changes(first.map, second.map)
    Console(stderr=quietly(json_out)).print(changes_table(old, new, found), crop=False)
    if json_out is not None:
        write_json(changed(stage, old, new, found), json_out)


def _versions(history: History, stage: StageKey) -> list[MapVersion]:
    from stagectl.maps.active import map_versions

    return map_versions(history, stage)


def _chosen(
    versions: list[MapVersion], number: int | None, name: str, last: bool = False
) -> MapVersion:
    from stagectl.errors import UnusableInput

    if not versions:
        raise UnusableInput(f"{name}: no map yet; 'stagectl calibrate' or 'stagectl map build'")
    if number is None:
        active = [v for v in versions if v.active]
        return active[0] if active and not last else versions[-1]
    for version in versions:
        if version.number == number:
            return version
    raise UnusableInput(f"{name}: no map {number}; there are 1 to {versions[-1].number}")


def _before(versions: list[MapVersion], version: MapVersion) -> MapVersion | None:
    older = [v for v in versions if v.number < version.number]
    return older[-1] if older else None


def _before_present(history: History, stage: StageKey) -> int | None:
    """The version in use before the present one; rollbacks go further back, not to and fro."""
    from stagectl.errors import UnusableInput

    used: list[int | None] = [None]
    for entry in history.activations(stage):
        if entry.reason == "rolled back":
            if len(used) > 1:
                used.pop()
        elif entry.number != used[-1]:
            used.append(entry.number)
    if len(used) < 2:
        raise UnusableInput(f"{history.name}: {stage}: no map is in use: nothing to roll back")
    return used[-2]


def _apply(
    history: History, stage: StageKey, version: MapVersion, machine: Path | None, max_age: float,
    reason: str | None, json_out: Path | None,
) -> None:  # fmt: skip
    """Check a version, and put it into use where there is a reason to; what was found is said."""
    from datetime import UTC, datetime

    from stagectl.errors import UnusableInput
    from stagectl.maps.applicable import outdated, problems
    from stagectl.maps.plain import applied

    now, quiet = datetime.now(UTC).timestamp(), quietly(json_out)
    found = [*problems(version.map, machine_of(machine)), *outdated(version.map, now, max_age)]
    grave = [problem.text for problem in found if problem.grave]
    if grave and machine is None and stage.machine != machine_of(None).name:
        grave.append(f"name the machine file of {stage.machine}: --machine")
    if json_out is not None:
        write_json(applied(stage, version.number, found, None if grave else reason), json_out)
    if grave:
        raise UnusableInput(
            f"{history.name}: map {version.number} cannot be applied: {'; '.join(grave)}"
        )
    for problem in found:
        click.echo(f"note: {problem.text}", err=quiet)
    if reason is None:
        click.echo(f"map {version.number} can be applied", err=quiet)
        return
    history.activate(stage, version.number, now, reason)
    click.echo(f"{stage}: map {version.number} is in use from now on ({reason})", err=quiet)
