"""Options and lookups of commands that read the friction history and its maps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.files import HistoryFile

if TYPE_CHECKING:
    from stagectl.history import History, StageKey
    from stagectl.maps import MapVersion

DEFAULT_FILES = ("runs/stage.db", "stage.db")
"""Where a history is looked for."""


OpenHistory = Callable[..., AbstractContextManager[tuple["History", "StageKey"]]]
"""Opens the selected history, for writing with `write=True`; see `_open_history`."""
Has = Callable[["History", "StageKey"], bool]
"""Whether a stage has in a history what a command needs."""


def has_maps(history: History, stage: StageKey) -> bool:
    """Whether there is a map of a stage."""
    return bool(history.maps(stage))


def has_estimates(history: History, stage: StageKey) -> bool:
    """Whether a map of a stage could be built: it has accepted estimates."""
    return history.counted(stage)[0] > 0


def history_options(command: Callable[..., None]) -> Callable[..., None]:
    """`--history`, `--stage`, `--simulated/--real`; the command takes an `OpenHistory` instead."""

    @wraps(command)
    def with_history(
        history: str | None, stage_name: str | None, simulated: bool | None, **others: Any
    ) -> None:
        def open_history(
            write: bool = False, has: Has = has_maps
        ) -> AbstractContextManager[tuple[History, StageKey]]:
            return _open_history(history, stage_name, simulated, write, has)

        command(open_history, **others)

    decorated: Callable[..., None] = with_history
    for option in (
        click.option(
            "--simulated/--real",
            "simulated",
            default=None,
            help="The simulated or the real stage, where both qualify.",
        ),
        click.option(
            "--stage",
            "stage_name",
            help="Machine name, where the history has several that qualify.",
        ),
        click.option(
            "--history",
            type=HistoryFile(),
            help=f"Friction history to read.  [default: {' or '.join(DEFAULT_FILES)}]",
        ),
    ):
        decorated = option(decorated)
    return decorated


@contextmanager
def _open_history(
    where: str | None, stage_name: str | None, simulated: bool | None, write: bool, has: Has
) -> Iterator[tuple[History, StageKey]]:
    """The history, and the one stage in it that the options select; closed at the end.

    Where they select several, it is the only one that has what the command needs.

    Raises:
        UnusableInput: there is no history, or the options do not select exactly one stage.
    """
    from stagectl.errors import UnusableInput
    from stagectl.history import open_history

    if where is None:
        where = next((name for name in DEFAULT_FILES if Path(name).is_file()), None)
        if where is None:
            raise UnusableInput(
                f"no friction history here ({', '.join(DEFAULT_FILES)}); name one with --history"
            )
    history = open_history(where, write=False)
    try:
        known = history.stages()
        stages = [
            stage
            for stage in known
            if (stage_name is None or stage.machine == stage_name)
            and (simulated is None or stage.simulated == simulated)
        ]
        if len(stages) > 1:
            stages = [stage for stage in stages if has(history, stage)] or stages
        if len(stages) != 1:
            found = ", ".join(map(str, known)) or "nothing"
            hint = "not among them" if not stages else "which one? --stage, --simulated or --real"
            raise UnusableInput(f"{history.name}: has {found}: {hint}")
        if write:
            history.close()
            history = open_history(where, write=True)
        yield history, stages[0]
    finally:
        history.close()


def select_version(
    history: History, stage: StageKey, number: int | None, *, latest: bool = False
) -> MapVersion:
    """Version `number` of the stage's map.

    Args:
        history: to look in.
        stage: of the map.
        number: of the version; None for the active one, else the latest.
        latest: None stands for the latest, active or not.

    Raises:
        UnusableInput: there is no such version.
    """
    from stagectl.errors import UnusableInput
    from stagectl.maps import map_versions

    versions = map_versions(history, stage)
    if not versions:
        raise UnusableInput(
            f"{history.name}: no map yet; 'stagectl calibrate' or 'stagectl map build' makes one"
        )
    if number is None:
        active = [v for v in versions if v.active]
        return active[0] if active and not latest else versions[-1]
    for version in versions:
        if version.number == number:
            return version
    raise UnusableInput(f"{history.name}: no map {number}; there are 1 to {versions[-1].number}")
