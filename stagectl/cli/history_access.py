"""Which history, which stage and which map a command means."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from stagectl.config.machine import Machine
    from stagectl.history import History, StageKey
    from stagectl.maps import MapVersion

USUAL = ("runs/stage.db", "stage.db")
"""Where a history is looked for."""


def history_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """`--history`, `--stage`, `--simulated/--real`."""
    for option in (
        click.option(
            "--simulated/--real",
            "simulated",
            default=None,
            help="Of the simulated or of the real stage, where the history has both.",
        ),
        click.option("--stage", "stage_name", help="Name of the machine, where it has several."),
        click.option(
            "--history",
            metavar="FILE|URL",
            help=f"The friction history [{' or '.join(USUAL)}].",
        ),
    ):
        command = option(command)
    return command


def open_for(
    where: str | None, stage_name: str | None, simulated: bool | None, write: bool = False
) -> tuple[History, StageKey]:
    """The history, and the one stage that is meant.

    Raises:
        UnusableInput: there is no history, or not just one such stage in it.
    """
    from stagectl.errors import UnusableInput
    from stagectl.history import open_history

    if where is None:
        where = next((name for name in USUAL if Path(name).is_file()), None)
        if where is None:
            raise UnusableInput(
                f"no friction history here ({', '.join(USUAL)}); name one: --history"
            )
    history = open_history(where, write=False)
    stages = [
        stage
        for stage in history.stages()
        if (stage_name is None or stage.machine == stage_name)
        and (simulated is None or stage.simulated == simulated)
    ]
    known = ", ".join(map(str, history.stages())) or "nothing"
    if write and stages:
        history.close()
        history = open_history(where, write=True)
    if len(stages) != 1:
        history.close()
        what = "not there" if not stages else "which one? --stage, --simulated or --real"
        raise UnusableInput(f"{where}: has {known}: {what}")
    return history, stages[0]


def machine_of(path: Path | None) -> Machine:
    """The machine file of an option; None is the packaged one."""
    from stagectl.config.machine_file import load_machine

    return load_machine(path)


def versions_of(history: History, stage: StageKey) -> list[MapVersion]:
    """All versions of a stage's map."""
    from stagectl.maps import map_versions

    return map_versions(history, stage)


def chosen(
    versions: list[MapVersion], number: int | None, name: str, last: bool = False
) -> MapVersion:
    """Version `number`; None: the one in use, else (or where the `last` is asked for) the last one.

    Raises:
        UnusableInput: there is none.
    """
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
