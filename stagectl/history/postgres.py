"""PostgreSQL behind the history's port, for a fleet of stages (extra `postgres`, psycopg 3).

The tables of `schema` are in the schema `stagectl` of the database. Statements are the same as
for SQLite, except for the parameter marks.
"""

from __future__ import annotations

import logging
import math
import os
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from stagectl.config.history_address import UNNAMED, hide_passwords, shown_address
from stagectl.errors import StagectlError, UnusableInput, missing_extra
from stagectl.history.database import NoHistory, newer
from stagectl.history.schema import MIGRATIONS, READABLE

if TYPE_CHECKING:
    import psycopg

CONNECT_TIMEOUT = 5
"""For connecting [s]."""
STATEMENT_TIMEOUT = 10
"""For a statement [s]; the server ends it."""
PATIENCE = 12
"""For an answer [s]; after that the server or the network hangs, and the connection is cut."""
_ADDRESS = (
    "the address cannot be used: write postgresql://USER@HOST:PORT/DATABASE, special characters as "
    "%20 and the like, the password in PGPASSWORD or ~/.pgpass"
)
LOOK_EVERY = 0.25
"""Interval of the checks [s]."""
_LOCK = 0x53544743  # advisory lock during a migration


class PostgresDatabase:
    """A connection to a server.

    Args:
        url: postgresql://user@host/database, or any other form of libpq.
        write: False opens it for reading only.

    Raises:
        UnusableInput: psycopg is not installed, the server cannot be reached or refuses, or the
            tables were made by a newer version.
        StagectlError: the connection is lost.
    """

    def __init__(self, url: str, write: bool = True) -> None:
        try:
            import psycopg
        except ImportError:
            raise missing_extra("a history in PostgreSQL needs", "psycopg", "postgres") from None
        self._error = psycopg.Error
        # psycopg logs a lost connection; our error reports it already.
        logging.getLogger("psycopg").addHandler(logging.NullHandler())
        try:
            self._connection: psycopg.Connection[tuple[Any, ...]] = psycopg.connect(
                url, autocommit=True, connect_timeout=CONNECT_TIMEOUT,
                tcp_user_timeout=PATIENCE * 1000,
                options=f"-c search_path=stagectl -c statement_timeout={STATEMENT_TIMEOUT}s",
            )  # fmt: skip
        except psycopg.Error as error:
            name = shown_address(url)
            if name == UNNAMED:  # libpq's message quotes what it takes for a port or a key
                raise UnusableInput(f"{name}: {_ADDRESS}") from None
            reason = hide_passwords(_one_line(error), url)
            raise UnusableInput(f"{name}: {reason}") from None
        self._watchdog = Watchdog(self._connection.fileno(), PATIENCE)
        info = self._connection.info
        self.name = f"postgresql://{info.host}:{info.port}/{info.dbname}"
        try:
            if write:
                self._migrate()
            else:
                self._connection.read_only = True
            version = self._version()
            if version > len(MIGRATIONS):
                raise newer(self.name, version)
            if version < READABLE:
                problem = "tables of an older version" if version else "no history there"
                raise (UnusableInput if version else NoHistory)(f"{self.name}: {problem}")
        except BaseException:
            self.close()
            raise

    def _version(self) -> int:
        there = self.execute("SELECT to_regclass('stagectl.migration') IS NOT NULL")[0][0]
        if not there:
            return 0
        return int(self.execute("SELECT coalesce(max(number), 0) FROM migration")[0][0])

    def _migrate(self) -> None:
        if self._version() >= len(MIGRATIONS):
            return
        types = {
            "key": "BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY",
            "real": "DOUBLE PRECISION",
            "blob": "BYTEA",
        }
        with self.transaction():
            self.execute("SELECT pg_advisory_xact_lock(?)", (_LOCK,))
            self.execute("CREATE SCHEMA IF NOT EXISTS stagectl")
            self.execute(
                "CREATE TABLE IF NOT EXISTS migration (number INTEGER PRIMARY KEY, "
                "applied TIMESTAMPTZ NOT NULL DEFAULT now())"
            )
            for number in range(self._version(), len(MIGRATIONS)):
                for statement in MIGRATIONS[number]:
                    self.execute(statement.format(**types))
                self.execute("INSERT INTO migration (number) VALUES (?)", (number + 1,))

    def execute(self, sql: str, parameters: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """As `database.Database`."""
        try:
            with self._watchdog:
                cursor = self._connection.execute(_psycopg_marks(sql), parameters or None)
            return cursor.fetchall() if cursor.description is not None else []
        except self._error as error:
            raise self._failure(error) from error

    def execute_many(self, sql: str, rows: Sequence[Sequence[object]]) -> None:
        """As `database.Database`."""
        try:
            with self._watchdog, self._connection.cursor() as cursor:
                cursor.executemany(_psycopg_marks(sql), rows)
        except self._error as error:
            raise self._failure(error) from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """As `database.Database`."""
        try:
            with self._watchdog, self._connection.transaction():
                yield
        except self._error as error:
            raise self._failure(error) from error

    def close(self) -> None:
        """As `database.Database`."""
        self._watchdog.close()
        self._connection.close()

    def _failure(self, error: Exception) -> StagectlError:
        if self._watchdog.cut:
            return StagectlError(f"{self.name}: no answer for {PATIENCE} s")
        return StagectlError(f"{self.name}: {_one_line(error)}")


def _psycopg_marks(sql: str) -> Any:
    """With psycopg's parameter marks; our statements have no other `?` or `%`."""
    return sql.replace("?", "%s")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


class Watchdog:
    """Cuts a connection that does not answer in time; a context manager around each wait.

    The server's own `statement_timeout` does not help where the server or the network hangs. A
    thread here shuts the connection down, and whoever waits on it gets an error at once.

    Args:
        descriptor: of the connection's socket, which is duplicated.
        patience: for each wait [s]; a wait inside another one starts it again.

    Attributes:
        patience: [s].
        cut: whether the connection was cut.
    """

    def __init__(self, descriptor: int, patience: float) -> None:
        self.patience = patience
        self.cut = False
        self._until, self._depth = math.inf, 0
        self._over = threading.Event()
        self._socket = socket.socket(fileno=os.dup(descriptor))
        threading.Thread(target=self._watch, name="history watchdog", daemon=True).start()

    def __enter__(self) -> None:
        self._depth += 1
        self._until = time.monotonic() + self.patience

    def __exit__(self, *error: object) -> None:
        self._depth -= 1
        self._until = time.monotonic() + self.patience if self._depth else math.inf

    def close(self) -> None:
        """Stop watching; the connection stays as it is. Idempotent."""
        self._over.set()

    def _watch(self) -> None:
        with self._socket:
            while not self._over.wait(LOOK_EVERY):
                if time.monotonic() > self._until:
                    self.cut = True
                    with suppress(OSError):  # the other end may have closed it
                        self._socket.shutdown(socket.SHUT_RDWR)
                    return
