"""Histories to test on: SQLite always, PostgreSQL where there is a server (tests/postgres.py)."""

import pytest

from stagectl.history import open_history
from tests.postgres import serve
from tests.unit.stagectl.rows import estimate_record, run_entry


@pytest.fixture(scope="session")
def server():
    """A server of our own."""
    with serve() as server:
        yield server


@pytest.fixture
def emptied(server):
    """The server, without a history."""
    import psycopg

    with psycopg.connect(server.url, autocommit=True) as connection:
        connection.execute("DROP SCHEMA IF EXISTS stagectl CASCADE")
    return server


@pytest.fixture(params=["sqlite", "postgres"])
def where(request, tmp_path):
    """Name of a history that is not there yet."""
    if request.param == "sqlite":
        return str(tmp_path / "stage.db")
    return request.getfixturevalue("emptied").url


@pytest.fixture
def opened():
    """Open histories that are closed at the end of the test."""
    histories = []

    def go(where, write=True):
        histories.append(open_history(str(where), write))
        return histories[-1]

    yield go
    for history in histories:
        history.close()


@pytest.fixture
def a_run():
    return run_entry


@pytest.fixture
def an_estimate():
    return estimate_record
