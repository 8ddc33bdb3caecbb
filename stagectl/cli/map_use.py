"""`stagectl map build`, `activate` and `rollback`: which friction map runs use."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.history_access import (
    HistoryOptions,
    has_estimates,
    select_version,
)
from stagectl.cli.options import (
    FILE,
    JSON_OUT,
    NumberRange,
    UtcTime,
    is_json_on_stdout,
    option,
    takes,
    write_json,
)
from stagectl.errors import UnusableInput

if TYPE_CHECKING:
    from stagectl.history import History, StageKey
    from stagectl.maps import MapVersion

MAX_AGE = 365.0
"""Default age from which a map is refused [days]."""


@dataclass(frozen=True)
class _Check:
    """What a version is checked against."""

    machine: Path | None = option("Machine file that the map must fit.  [default: wafer-xy]", FILE)
    max_age: float = option("Refuse a map older than this [days].", NumberRange(0.0), MAX_AGE)


@click.command("build")
@takes(HistoryOptions)
@click.option(
    "--date",
    type=UtcTime(),
    default=math.inf,
    show_default=False,
    help="State of the map at this date, UTC [now].",
)
@click.option(
    "--since",
    type=UtcTime(),
    default=-math.inf,
    show_default=False,
    help="Ignore estimates before this date, UTC.",
)
@click.option("--comment", default="", show_default=False, help="Stored with the map.")
def build(histories: HistoryOptions, date: float, since: float, comment: str) -> None:
    """Build a new version from the estimates in the history. Runs use it once it is activated."""
    from stagectl.maps import build_map, to_json

    with histories.open(write=True, has=has_estimates) as (opened, stage):
        built = build_map(opened, stage, date, since)
        number = opened.save_map(stage, datetime.now(UTC).timestamp(), comment, to_json(built))
    sites = ", ".join(f"{name}: {len(axis.sites)} sites" for name, axis in built.axes.items())
    click.echo(
        f"map {number} of {stage} ({sites}); 'stagectl map activate {number}' puts it into use"
    )


@click.command("activate")
@click.argument("number", type=int, required=False)
@takes(HistoryOptions)
@takes(_Check)
@click.option("--check", is_flag=True, help="Only report whether it could be activated.")
@JSON_OUT
def activate(
    histories: HistoryOptions, against: _Check, number: int | None, check: bool,
    json_out: Path | None,
) -> None:  # fmt: skip
    """Put version NUMBER [the latest] into use: further runs with this history use it.

    Refused if the map does not fit the machine file or is too old.
    """
    with histories.open(write=not check) as (opened, stage):
        version = select_version(opened, stage, number, latest=True)
        reason = None if check else "activated"
        _activate(opened, stage, version, against, reason, json_out)


@click.command("rollback")
@takes(HistoryOptions)
@takes(_Check)
@JSON_OUT
def rollback(histories: HistoryOptions, against: _Check, json_out: Path | None) -> None:
    """Return to the version that was in use before the current one, or to none."""
    with histories.open(write=True) as (opened, stage):
        number = _previous_version(opened, stage)
        if number is not None:
            version = select_version(opened, stage, number)
            _activate(opened, stage, version, against, "rolled back", json_out)
            return
        from stagectl.maps.output import activation_as_json

        opened.activate(stage, None, datetime.now(UTC).timestamp(), "rolled back")
        click.echo(f"{stage}: no map in use", err=is_json_on_stdout(json_out))
        write_json(activation_as_json(stage, None, [], "rolled back"), json_out)


def _previous_version(history: History, stage: StageKey) -> int | None:
    """The version used before the current one; repeated rollbacks go further back each time."""
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


def _activate(
    history: History, stage: StageKey, version: MapVersion, against: _Check, reason: str | None,
    json_out: Path | None,
) -> None:  # fmt: skip
    """Check a version and report the findings; put it into use unless `reason` is None."""
    from stagectl.config import load_machine
    from stagectl.maps import outdated, problems
    from stagectl.maps.output import activation_as_json

    now, quiet = datetime.now(UTC).timestamp(), is_json_on_stdout(json_out)
    model = load_machine(against.machine)
    found = [*problems(version.map, model), *outdated(version.map, now, against.max_age)]
    grave = [problem.text for problem in found if problem.grave]
    if grave and against.machine is None and stage.machine != model.name:
        grave.append(f"name the machine file of {stage.machine} with --machine")
    write_json(
        activation_as_json(stage, version.number, found, None if grave else reason), json_out
    )
    if grave:
        raise UnusableInput(
            f"{history.name}: map {version.number} cannot be activated: {'; '.join(grave)}"
        )
    for problem in found:
        click.echo(f"note: {problem.text}", err=quiet)
    if reason is None:
        click.echo(f"map {version.number} can be activated", err=quiet)
        return
    history.activate(stage, version.number, now, reason)
    click.echo(f"{stage}: map {version.number} is in use from now on ({reason})", err=quiet)
