"""The thread that writes a history: what it does while the database can't, and afterwards."""

import socket
import threading

import pytest

from stagectl.config import without_password
from stagectl.errors import StagectlError
from stagectl.history import HistoryWriter, StageKey, StepRecord, open_history
from tests.sqlite_lock import locked

BEGIN = 1.7e9
STAGE = StageKey("wafer-xy", True)
ENOUGH = 60.0
"""No test waits for so long where all is well [s]."""


@pytest.fixture
def begun(where, opened, a_run):
    """A run, its number in a history, and what opens that."""
    entry = a_run(uuid="5eed")
    return entry, opened(where).start_run(entry), lambda: open_history(where, write=True)


def test_records_are_filed_in_order(where, opened, begun, an_estimate):
    entry, number, reopen = begun
    writer = HistoryWriter(reopen, entry)
    for n in range(1, 501):
        writer.enqueue(an_estimate(number, number=n, time=BEGIN + n))
        if n % 100 == 0:
            step = StepRecord(number, "x", (0.0, 0.0), BEGIN + n, 0.1, "site", n // 100)
            writer.enqueue(step)
    writer.end(lambda history, run: history.end_run(run, "completed", None, 500), ENOUGH)
    assert (writer.complete, writer.filed, writer.failure) == (True, 500, None)
    history = opened(where, write=False)
    times = history.trend(STAGE, "x", (0.01, -0.02)).time
    assert [t - BEGIN for t in times] == list(range(1, 501))
    assert len(history.steps(STAGE)) == 5
    assert (history.runs(STAGE)[0][2], history.unfiled(STAGE)) == ("completed", [])


def test_the_run_is_entered_first_and_its_records_get_its_number(where, opened, a_run, an_estimate):
    other = opened(where).start_run(a_run(uuid="0ther"))
    writer = HistoryWriter(lambda: open_history(where, write=True), a_run(uuid="5eed"))
    writer.enqueue(an_estimate(0, number=1))
    writer.enqueue(StepRecord(0, "x", (0.0, 0.0), BEGIN, 0.1, "site", 1))
    writer.end(lambda history, run: history.end_run(run, "completed", None, 1), ENOUGH)
    history = opened(where, write=False)
    ended = {run: outcome for run, _, outcome in history.runs(STAGE)}
    (step,) = history.steps(STAGE)
    assert ended == {other: None, step.run: "completed"}
    assert history.filed(step.run) == 1


def test_a_locked_file_delays_only_the_writer(tmp_path, opened, a_run, an_estimate):
    path = str(tmp_path / "stage.db")
    entry = a_run(uuid="5eed")
    number = opened(path).start_run(entry)
    with locked(path):
        writer = HistoryWriter(lambda: open_history(path, write=True), entry)
        for n in range(1, 301):
            writer.enqueue(an_estimate(number, number=n))
        assert (writer.filed, writer.dropped) == (0, 0)  # all of them taken, none written yet
        with pytest.raises(StagectlError, match="another program is writing"):
            opened(path).end_run(number, "completed")
    writer.end(lambda history, run: history.end_run(run, "completed", None, 300), ENOUGH)
    assert (writer.complete, writer.filed) == (True, 300)
    assert opened(path).filed(number) == 300


class Absent:
    """A history that lets nobody in until it is released."""

    def __init__(self):
        self.there = threading.Event()

    def __call__(self):
        self.there.wait()
        raise StagectlError("gone for good")


def test_queue_and_waiting_are_limited(a_run, an_estimate):
    absent = Absent()
    writer = HistoryWriter(absent, a_run(uuid="5eed"), limit=3)
    for n in range(1, 6):
        writer.enqueue(an_estimate(1, number=n))
    assert (writer.dropped, writer.filed) == (2, 0)
    writer.end(lambda history, run: pytest.fail("there is none"), patience=0.05)
    assert not writer.complete
    absent.there.set()


def test_dropped_records_are_left_to_an_import(where, opened, begun, an_estimate):
    entry, number, reopen = begun
    there = threading.Event()

    def late():
        there.wait()
        return reopen()

    writer = HistoryWriter(late, entry, limit=3)
    for n in range(1, 6):
        writer.enqueue(an_estimate(number, number=n))
    there.set()
    writer.end(lambda history, run: history.end_run(run, "completed", None, None), ENOUGH)
    assert (writer.complete, writer.filed, writer.dropped) == (False, 3, 2)
    assert [uuid for uuid, _ in opened(where).unfiled(STAGE)] == ["5eed"]


@pytest.fixture
def of_server(server, opened, a_run):
    """A run, its number in a history on a server, and what opens that."""
    import psycopg

    with psycopg.connect(server.url, autocommit=True) as connection:
        connection.execute("DROP SCHEMA IF EXISTS stagectl CASCADE")
    history = opened(server.url)
    entry = a_run(uuid="5eed")
    number = history.start_run(entry)
    history.close()
    return entry, number, lambda: open_history(server.url, write=True)


def test_a_restarted_server_gets_what_it_missed(server, of_server, opened, an_estimate):
    entry, number, reopen = of_server
    writer = HistoryWriter(reopen, entry)
    filed = threading.Event()
    writer.enqueue(an_estimate(number, number=1))
    while not writer.filed:  # it is connected
        filed.wait(0.01)
    server.stop()
    for n in range(2, 300):
        writer.enqueue(an_estimate(number, number=n))
    while writer.failure is None:
        filed.wait(0.01)
    assert "\n" not in writer.failure
    server.start()
    writer.end(lambda history, run: history.end_run(run, "completed", None, 299), ENOUGH)
    assert (writer.complete, writer.filed, writer.failure) == (True, 299, None)
    assert opened(server.url).filed(number) == 299


def test_a_server_that_stops_answering_is_cut_off_and_tried_again(
    server, of_server, opened, an_estimate, capfd
):
    """Its own time-outs are worth nothing then: the client cuts the connection."""
    entry, number, reopen = of_server
    writer = HistoryWriter(reopen, entry)
    seen = threading.Event()
    writer.enqueue(an_estimate(number, number=1))
    while not writer.filed:
        seen.wait(0.01)
    with server.hung():
        for n in range(2, 300):
            writer.enqueue(an_estimate(number, number=n))
        while writer.failure is None:
            seen.wait(0.01)
        assert "no answer for 12 s" in writer.failure or "timeout" in writer.failure
        assert writer.filed == 1
        with pytest.raises(StagectlError, match="timeout"):  # what a run would begin with
            opened(server.url)
    writer.end(lambda history, run: history.end_run(run, "completed", None, 299), ENOUGH)
    assert (writer.complete, writer.filed) == (True, 299)
    assert opened(server.url).filed(number) == 299
    assert capfd.readouterr().err == ""


def test_a_server_that_never_answers_is_refused_in_one_line():
    """As behind a firewall that drops everything: the connection is there, and silent."""
    pytest.importorskip("psycopg")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(StagectlError) as refused:
            open_history(f"postgresql://stage:secret@127.0.0.1:{port}/fleet", write=True)
    assert f"127.0.0.1:{port}/fleet" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "secret" not in str(refused.value)


@pytest.mark.parametrize(
    ("where", "named"),
    [
        ("postgresql://u:s3cret@host:5433/db", "postgresql://u@host:5433/db"),
        ("postgresql://u:s3?cret@h/db?sslmode=require", "postgresql://u@h/db?sslmode=require"),
        ("postgres://h/db?user=u&password=s3cret", "postgres://h/db?user=u"),
        ("postgresql://h/db?pass%77ord=s3cret", "postgresql://h/db"),
        ("postgresql:///db?host=/tmp/x", "postgresql:///db?host=/tmp/x"),
        ("postgresql://stage@/db", "postgresql://stage@/db"),
        ("/var/stage.db", "/var/stage.db"),
    ],
)
def test_a_recording_names_its_history_without_password(where, named):
    assert without_password(where) == named


def test_a_history_in_a_file_is_named_by_its_absolute_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert without_password("runs/stage.db") == str(tmp_path / "runs" / "stage.db")
