"""Which history is meant by what a user writes, and opening it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from stagectl.history.port import History

if TYPE_CHECKING:
    from stagectl.config.machine import Machine

FILE_NAME = "stage.db"
OFF = "none"
"""Instead of a file: no history."""
_USER = re.compile(r"(?P<user>[^@/:]*)[^@/]*@")  # as libpq reads it
_PASSWORDS = ("password", "sslpassword")


def is_server(where: str) -> bool:
    """Whether this names a PostgreSQL database instead of a file."""
    return where.startswith(("postgresql://", "postgres://"))


def without_password(where: str) -> str:
    """The same history as a recording may name it: a path from the root, a URL without a password.

    Who opens it again has it where libpq looks for it: PGPASSWORD, ~/.pgpass.
    """
    if not is_server(where):
        return str(Path(where).absolute())
    scheme, _, rest = where.partition("://")
    if given := _USER.match(rest):
        rest = f"{given['user']}@{rest[given.end() :]}"
    rest, _, query = rest.partition("?")
    options = [o for o in query.split("&") if unquote(o.partition("=")[0]) not in _PASSWORDS]
    return f"{scheme}://{rest}" + (f"?{'&'.join(options)}" if query and options else "")


def open_history(where: str, write: bool = False) -> History:
    """The history in a file, or on a server.

    Args:
        where: path of a `stage.db`, or postgresql://...
        write: make it where there is none, and bring its tables up to date.

    Raises:
        UnusableInput: there is none, or it is none that this version can use.
        StagectlError: it cannot be opened.
    """
    from stagectl.history.sql import SqlHistory

    if is_server(where):
        from stagectl.history.postgres import PostgresDatabase

        return SqlHistory(PostgresDatabase(where, write))
    from stagectl.history.database import SqliteDatabase

    return SqlHistory(SqliteDatabase(Path(where), write))


def named_in(machine: Machine) -> str | None:
    """What the machine file says of the history; files are beside the machine file."""
    where = machine.history
    if where is None or where == OFF or is_server(where):
        return where
    return str(Path(machine.source).parent / where)


def default_history(
    named: str | None, machine: Machine, simulated: bool, folder: Path, own: bool
) -> str | None:
    """Where a run's history goes: the option, else the machine file's key, else near its files.

    A simulated run never gets the machine file's: virtual friction has no business in a real
    stage's history unless it is asked for. Where the user names a folder, nothing outside of it is
    touched, and a simulated run, of which there may be thousands, leaves no history there either.

    Args:
        named: `--history`; "none" for no history.
        machine: the run's.
        simulated: on virtual drives.
        folder: of the run's files.
        own: whether the user named the folder; else it is one of many under `runs`, and the
            history stands beside them.
    """
    if named is None and not simulated:
        named = named_in(machine)
    if named is not None:
        return None if named == OFF else named
    if own:
        return None if simulated else str(folder / FILE_NAME)
    return str(folder.parent / FILE_NAME)
