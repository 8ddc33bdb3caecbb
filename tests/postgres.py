"""A PostgreSQL server of the tests' own, which they may also hang, restart and stop.

In a folder of its own, on a Unix socket only. Without Debian's `postgresql` its tests are skipped,
and with STAGECTL_REQUIRE_POSTGRES=1 they fail instead.
"""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

REQUIRED = "STAGECTL_REQUIRE_POSTGRES"


class Server:
    """A running server.

    Attributes:
        url: of its database.
    """

    def __init__(self, tools: Path, base: Path, user: dict[str, object]) -> None:
        self.url = f"postgresql://stage@/postgres?host={base}"
        self._tools, self._base, self._user = tools, base, user
        self._data = str(base / "data")
        self._tool(
            "initdb", "-D", self._data, "-A", "trust", "-U", "stage", "-E", "UTF8", "--no-sync"
        )
        self.start()

    def start(self) -> None:
        self._tool(
            "pg_ctl", "-D", self._data, "-w", "-l", str(self._base / "log"), "-o",
            f"-c listen_addresses='' -c unix_socket_directories={self._base} -c fsync=off", "start",
        )  # fmt: skip

    def stop(self) -> None:
        self._tool("pg_ctl", "-D", self._data, "-m", "immediate", "stop")

    @contextmanager
    def hung(self) -> Iterator[None]:
        """It answers nobody, and what it was in the middle of goes on afterwards."""
        processes = self._processes()
        for process in processes:
            os.kill(process, signal.SIGSTOP)
        try:
            yield
        finally:
            for process in processes:
                with suppress(ProcessLookupError):  # had ended, unnoticed by the postmaster
                    os.kill(process, signal.SIGCONT)

    def _processes(self) -> list[int]:
        """The postmaster first, so that it makes no more of them."""
        postmaster = int((self._base / "data" / "postmaster.pid").read_text().split()[0])
        os.kill(postmaster, signal.SIGSTOP)
        children = subprocess.run(
            ["ps", "-o", "pid=", "--ppid", str(postmaster)],
            capture_output=True, text=True, check=True,
        ).stdout.split()  # fmt: skip
        return [postmaster, *map(int, children)]

    def _tool(self, name: str, *arguments: str) -> None:
        subprocess.run(
            [self._tools / name, *arguments], check=True, cwd=self._base, timeout=60,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **self._user,
        )  # type: ignore[call-overload]  # fmt: skip


@contextmanager
def serve() -> Iterator[Server]:
    """A server until the end of the context; the test is skipped where there can be none."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    if not found:
        _missing("no initdb under /usr/lib/postgresql")
    try:
        import psycopg  # noqa: F401
    except ImportError:
        _missing("psycopg is not installed")
    base = Path(tempfile.mkdtemp(prefix="stagectl-pg-"))  # short: a socket's path has 107 bytes
    user: dict[str, object] = {}
    if os.geteuid() == 0:  # the server refuses root
        try:
            entry = pwd.getpwnam("postgres")
        except KeyError:
            _missing("running as root, and there is no user postgres to start the server as")
        os.chown(base, entry.pw_uid, entry.pw_gid)
        user = {"user": entry.pw_uid, "group": entry.pw_gid, "extra_groups": []}
    try:
        server = Server(found[-1].parent, base, user)
    except (OSError, subprocess.SubprocessError) as error:
        shutil.rmtree(base, ignore_errors=True)
        _missing(f"the server does not start: {error}")
    try:
        yield server
    finally:
        server.stop()
        shutil.rmtree(base, ignore_errors=True)


def _missing(reason: str) -> None:
    if os.environ.get(REQUIRED):
        pytest.fail(f"{reason}, and {REQUIRED} is set")
    pytest.skip(f"PostgreSQL history NOT TESTED: {reason} (apt-get install postgresql)")
