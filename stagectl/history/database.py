"""What the history needs of a database, and SQLite as one.

SQLite runs in WAL mode: one writer, and any number of readers that never wait for it. A commit has
reached the kernel when it returns, so a killed process loses none (`synchronous = NORMAL`: a power
failure may lose the last commits but does not corrupt the file).
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

from stagectl.errors import StagectlError, UnusableInput
from stagectl.history.schema import APPLICATION_ID, MIGRATIONS, READABLE

BUSY_TIMEOUT = 2.0
"""How long a write waits for another program's write lock [s]."""


class NoHistory(UnusableInput):
    """There is no history yet; opening it for writing would create one."""


class Database(Protocol):
    """A connection; parameters in SQL are `?`.

    Attributes:
        name: for errors.
    """

    name: str

    def execute(self, sql: str, parameters: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Run one statement and return all its rows.

        Raises:
            StagectlError: the database refuses.
        """

    def execute_many(self, sql: str, rows: Sequence[Sequence[object]]) -> None:
        """Run one statement for each row of parameters; errors as `execute`."""

    def transaction(self) -> Any:
        """A context manager: all statements in it take effect, or none."""

    def close(self) -> None:
        """Close the connection; idempotent."""


class SqliteDatabase:
    """`stage.db`.

    Args:
        path: of the file, created if `write` is set.
        write: False opens it for reading only.

    Raises:
        UnusableInput: it does not exist, is not a history, or was made by a newer version.
        StagectlError: it cannot be opened or migrated.
    """

    def __init__(self, path: Path, write: bool = True) -> None:
        self.name = str(path)
        if path.is_dir():
            raise UnusableInput(f"{path}: is a folder, not a history")
        if not write and not path.is_file():
            raise NoHistory(f"{path}: no such history")
        mode = "mode=rwc" if write else _mode_to_read(path)
        try:
            self._connection = sqlite3.connect(
                f"{path.absolute().as_uri()}?{mode}", uri=True, isolation_level=None,
                timeout=BUSY_TIMEOUT, cached_statements=64,
            )  # fmt: skip
        except sqlite3.Error as error:
            raise _refusal(self.name, error) from error
        try:
            if not write:
                self.execute("PRAGMA query_only = ON")
            self._check(write)
        except BaseException:
            self._connection.close()
            raise

    def _check(self, write: bool) -> None:
        tables = self._number("SELECT count(*) FROM sqlite_master")
        if tables and self._number("PRAGMA application_id") != APPLICATION_ID:
            raise UnusableInput(f"{self.name}: an SQLite file, but not a history of stagectl")
        if not tables and not write:
            raise NoHistory(f"{self.name}: empty, not a history")
        version = self._number("PRAGMA user_version")
        if version > len(MIGRATIONS):
            raise newer(self.name, version)
        if write:
            self.execute("PRAGMA journal_mode = WAL")
            self.execute("PRAGMA synchronous = NORMAL")
            self.execute("PRAGMA foreign_keys = ON")
            self._migrate()
        elif version < READABLE:
            raise UnusableInput(
                f"{self.name}: tables of version {version}; open it once for writing "
                f"(any run does) to bring them to {len(MIGRATIONS)}"
            )

    def _migrate(self) -> None:
        if self._number("PRAGMA user_version") == len(MIGRATIONS):
            return
        types = {"key": "INTEGER PRIMARY KEY", "real": "REAL", "blob": "BLOB"}
        with self.transaction():  # checked again inside: another process may have done it
            for number in range(self._number("PRAGMA user_version"), len(MIGRATIONS)):
                for statement in MIGRATIONS[number]:
                    self.execute(statement.format(**types))
                self.execute(f"PRAGMA user_version = {number + 1}")
            self.execute(f"PRAGMA application_id = {APPLICATION_ID}")

    def _number(self, sql: str) -> int:
        return int(self.execute(sql)[0][0])

    def execute(self, sql: str, parameters: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """As `Database`."""
        try:
            return self._connection.execute(sql, tuple(parameters)).fetchall()
        except sqlite3.Error as error:
            raise _refusal(self.name, error) from error

    def execute_many(self, sql: str, rows: Sequence[Sequence[object]]) -> None:
        """As `Database`."""
        try:
            self._connection.executemany(sql, rows)
        except sqlite3.Error as error:
            raise _refusal(self.name, error) from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Take the write lock at once, so that no later statement fails for lack of it."""
        self.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise

    def close(self) -> None:
        """As `Database`."""
        self._connection.close()


def newer(name: str, version: int) -> UnusableInput:
    """The refusal of tables of a newer version."""
    return UnusableInput(
        f"{name}: tables of version {version}, made by a newer stagectl; this one knows up to "
        f"{len(MIGRATIONS)}"
    )


def _mode_to_read(path: Path) -> str:
    """How SQLite opens a file to read it, such that no new files stay next to it.

    It makes two (`-wal`, `-shm`), and the last of its users takes them away, but only one that may
    write. In a folder that cannot be written it needs none, unless a log holds the last commits.
    """
    if os.access(path.absolute().parent, os.W_OK):
        return "mode=rw"
    log = path.with_name(f"{path.name}-wal")
    return "mode=ro" if log.exists() else "mode=ro&immutable=1"


def _refusal(name: str, error: sqlite3.Error) -> StagectlError:
    if isinstance(error, sqlite3.DatabaseError) and "not a database" in str(error):
        return UnusableInput(f"{name}: not an SQLite file")
    if "malformed" in str(error):
        return UnusableInput(f"{name}: damaged: {error}")
    if "locked" in str(error):
        return StagectlError(f"{name}: another program is writing to it")
    if "unable to open" in str(error) or "readonly" in str(error):
        folder = Path(name).absolute().parent
        return UnusableInput(f"{name}: {error}; can it, and its folder {folder}, be written?")
    return StagectlError(f"{name}: {error}")
