"""Histories to test on: SQLite always, PostgreSQL where there is a server (tests/postgres.py)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest

from stagectl.history import EstimateRecord, History, RunEntry, StageKey, open_history
from tests.postgres import Server, serve

STAGE = StageKey("wafer-xy", True)
BEGIN = 1.7e9


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    with serve() as server:
        yield server


@pytest.fixture(scope="session")
def postgres(server: Server) -> str:
    """URL of a server of our own."""
    return server.url


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
