"""Options and lookups of commands that read the friction history and its maps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stagectl.cli.files import HistoryFile
from stagectl.cli.options import option
from stagectl.errors import UnusableInput

if TYPE_CHECKING:
    from stagectl.history import History, StageKey
    from stagectl.maps import MapVersion

DEFAULT_FILES = ("runs/stage.db", "stage.db")
"""Where a history is looked for."""


Has = Callable[["History", "StageKey"], bool]
"""Whether a stage has in a history what a command needs."""


def has_maps(history: History, stage: StageKey) -> bool:
    """Whether there is a map of a stage."""
    return bool(history.maps(stage))


def has_estimates(history: History, stage: StageKey) -> bool:
    """Whether a map of a stage could be built: it has accepted estimates."""
    return history.counted(stage)[0] > 0


@dataclass(frozen=True)
class HistoryOptions:
    """Options that select a stage of a history."""

    history: str | None = option(
        f"Friction history to read.  [default: {' or '.join(DEFAULT_FILES)}]", HistoryFile()
    )
    stage: str | None = option("Machine name, where the history has several that qualify.")
    simulated: bool | None = option(
        "The simulated or the real stage, where both qualify.", flags="--simulated/--real"
    )

    @contextmanager
    def open(self, write: bool = False, has: Has = has_maps) -> Iterator[tuple[History, StageKey]]:
        """The history, and the one stage in it that the options select; closed at the end.

        Args:
            write: open it for writing, too.
            has: what the command needs: of several stages it is the only one that has it.

        Raises:
            UnusableInput: there is no history, or the options do not select exactly one stage.
        """
        from stagectl.history import open_history

        where = self.history
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
                if self.stage in (None, stage.machine) and self.simulated in (None, stage.simulated)
            ]
            if len(stages) > 1:
                stages = [stage for stage in stages if has(history, stage)] or stages
            if len(stages) != 1:
                found = ", ".join(map(str, known)) or "nothing"
                hint = "which one? --stage, --simulated or --real" if stages else "not among them"
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
