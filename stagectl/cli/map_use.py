"""`stagectl map`: how a map comes into use, and out of it: `build`, `activate`, `rollback`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.history_access import chosen, history_options, machine_of, open_for, versions_of
from stagectl.cli.options import FILE, JSON_OUT, NumberRange, quietly, write_json

if TYPE_CHECKING:
    from stagectl.history import History, StageKey
    from stagectl.maps import MapVersion

MAX_AGE = 365.0
"""A map of so long ago [days] is not put into use without being asked for."""


@click.command("build", short_help="Make a new version out of the history.")
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

    from stagectl.maps import build_map, to_json

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


@click.command("activate", short_help="Put a version into use, once it is known to fit.")
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
        version = chosen(versions_of(opened, stage), number, opened.name, last=True)
        _apply(opened, stage, version, machine, max_age, None if check else "activated", json_out)
    finally:
        opened.close()


@click.command("rollback", short_help="Back to the version that was in use before.")
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

            from stagectl.maps import applied

            opened.activate(stage, None, datetime.now(UTC).timestamp(), "rolled back")
            click.echo(f"{stage}: no map in use", err=quietly(json_out))
            if json_out is not None:
                write_json(applied(stage, None, [], "rolled back"), json_out)
            return
        version = chosen(versions_of(opened, stage), before, opened.name)
        _apply(opened, stage, version, machine, max_age, "rolled back", json_out)
    finally:
        opened.close()


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
    from stagectl.maps import applied, outdated, problems

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
