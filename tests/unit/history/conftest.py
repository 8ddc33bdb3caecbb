"""Histories to test on: SQLite always, PostgreSQL where Debian's `postgresql` is installed.

The server is started by the session, in a folder of its own, on a Unix socket only. Without it its
tests are skipped, and with STAGECTL_REQUIRE_POSTGRES=1 they fail instead.
"""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest

from stagectl.history.opening import open_history
from stagectl.history.port import History
from stagectl.history.records import EstimateRecord, RunEntry, StageKey

REQUIRED = "STAGECTL_REQUIRE_POSTGRES"
STAGE = StageKey("wafer-xy", True)
BEGIN = 1.7e9


def missing(reason: str) -> None:
    if os.environ.get(REQUIRED):
        pytest.fail(f"{reason}, and {REQUIRED} is set")
    pytest.skip(f"PostgreSQL history NOT TESTED: {reason} (apt-get install postgresql)")


@pytest.fixture(scope="session")
def postgres() -> Iterator[str]:
    """URL of a server of our own."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    if not found:
        missing("no initdb under /usr/lib/postgresql")
    try:
        import psycopg  # noqa: F401
    except ImportError:
        missing("psycopg is not installed")
    tools = found[-1].parent
    base = Path(tempfile.mkdtemp(prefix="stagectl-pg-"))  # short: a socket's path has 107 bytes
    user: dict[str, object] = {}
    if os.geteuid() == 0:  # the server refuses root
        try:
            entry = pwd.getpwnam("postgres")
        except KeyError:
            missing("running as root, and there is no user postgres to start the server as")
        os.chown(base, entry.pw_uid, entry.pw_gid)
        user = {"user": entry.pw_uid, "group": entry.pw_gid, "extra_groups": []}

    def tool(name: str, *arguments: str) -> None:
        subprocess.run(
            [tools / name, *arguments], check=True, cwd=base, timeout=60,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **user,
        )  # type: ignore[call-overload]  # fmt: skip

    data = str(base / "data")
    try:
        tool("initdb", "-D", data, "-A", "trust", "-U", "stage", "-E", "UTF8", "--no-sync")
        tool(
            "pg_ctl", "-D", data, "-w", "-l", str(base / "log"),
            "-o", f"-c listen_addresses='' -c unix_socket_directories={base} -c fsync=off", "start",
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError) as error:
        shutil.rmtree(base, ignore_errors=True)
        missing(f"the server does not start: {error}")
    try:
        yield f"postgresql://stage@/postgres?host={base}"
    finally:
        tool("pg_ctl", "-D", data, "-m", "immediate", "stop")
        shutil.rmtree(base, ignore_errors=True)


@pytest.fixture(params=["sqlite", "postgres"])
def where(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Name of a history that is not there yet."""
    if request.param == "sqlite":
        return str(tmp_path / "stage.db")
    import psycopg

    url: str = request.getfixturevalue("postgres")
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("DROP SCHEMA IF EXISTS stagectl CASCADE")
    return url


@pytest.fixture
def opened() -> Iterator[Callable[..., History]]:
    """Open histories that are closed at the end of the test."""
    histories: list[History] = []

    def go(where: object, write: bool = True) -> History:
        histories.append(open_history(str(where), write))
        return histories[-1]

    yield go
    for history in histories:
        history.close()


@pytest.fixture
def a_run() -> Callable[..., RunEntry]:
    number = count(1)

    def make(stage: StageKey = STAGE, started: float = BEGIN, **other: object) -> RunEntry:
        values: dict[str, object] = {
            "recipe": "r", "lot": "L1", "wafer": f"W{next(number)}", "software": "stagectl 0",
            "folder": "runs/x",
        }  # fmt: skip
        return RunEntry(stage, ("x", "y"), started, **(values | other))  # type: ignore[arg-type]

    return make


@pytest.fixture
def an_estimate() -> Callable[..., EstimateRecord]:
    def make(run: int, **other: object) -> EstimateRecord:
        values: dict[str, object] = {
            "axis": "x", "kind": "macro", "site": 1, "place": (0.01, -0.02), "time": BEGIN + 1.0,
            "distance": 0.025, "accepted": True, "reason": None,
            "figures": {"coulomb": 6.0, "viscous": 20.0},
            "covariance": (0.04, 0.01, 0.01, 0.25),
        }  # fmt: skip
        return EstimateRecord(run, **(values | other))  # type: ignore[arg-type]

    return make
