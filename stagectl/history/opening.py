"""Which history a run or command uses, and opening it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from stagectl.config.history_address import OFF, is_path, is_server
from stagectl.history.database import NoHistory, SqliteDatabase

if TYPE_CHECKING:
    from stagectl.config.machine import Machine
    from stagectl.history.sql import History

FILE_NAME = "stage.db"


def open_history(where: str, write: bool = False) -> History:
    """Open the history in a file or on a server.

    Args:
        where: path of a `stage.db`, or the address of a server.
        write: create it if necessary, and migrate its tables.

    Raises:
        UnusableInput: it does not exist, or this version cannot use it.
        StagectlError: it cannot be opened.
    """
    from stagectl.history.sql import History

    if is_server(where):
        from stagectl.history.postgres import PostgresDatabase

        return History(PostgresDatabase(where, write))
    return History(SqliteDatabase(Path(where), write))


@contextmanager
def existing_history(where: str | None) -> Iterator[History | None]:
    """A history for reading, closed at the end; None where there is none, or none yet.

    Raises:
        UnusableInput: this version cannot use it.
        StagectlError: it cannot be opened.
    """
    history = None
    if where is not None:
        with suppress(NoHistory):
            history = open_history(where)
    with nullcontext() if history is None else closing(history):
        yield history


def machine_history(machine: Machine) -> str | None:
    """The history that a machine file names; a path is relative to that file."""
    where = machine.history
    if where is None or not is_path(where):
        return where
    return str(Path(machine.source).parent / where)


def default_history(
    named: str | None, machine: Machine, simulated: bool, folder: Path, own: bool
) -> str | None:
    """The history of a run: by the option, else by the machine file, else near the run's files.

    A simulated run does not use the machine file's history, so that simulated friction enters a
    real stage's history only on request. If the user names the folder, nothing outside it is
    written, and simulated runs (there may be thousands) have no history by default.

    Args:
        named: `--history`; "none" for no history.
        machine: of the run.
        simulated: on virtual drives.
        folder: of the run's files.
        own: the user named the folder; else it is one of many under `runs`, which share a history.
    """
    if named is None and not simulated:
        named = machine_history(machine)
    if named is not None:
        return None if named == OFF else named
    if own:
        return None if simulated else str(folder / FILE_NAME)
    return str(folder.parent / FILE_NAME)
