"""The thread that writes a history: what it does while the database can't, and afterwards."""

import socket
import threading

import pytest

from stagectl.errors import StagectlError
from stagectl.history import HistoryWriter, StepRecord, open_history
from tests.sqlite_lock import locked
from tests.unit.stagectl.rows import BEGIN, STAGE
from tests.waiting import wait_until

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


def test_queue_and_waiting_are_limited(a_run, an_estimate):
    there = threading.Event()

    def absent():
        there.wait()
        raise StagectlError("gone for good")

    writer = HistoryWriter(absent, a_run(uuid="5eed"), limit=3)
    for n in range(1, 6):
        writer.enqueue(an_estimate(1, number=n))
    assert (writer.dropped, writer.filed) == (2, 0)
    writer.end(lambda history, run: pytest.fail("there is none"), patience=0.05)
    assert not writer.complete
    there.set()


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
def connected(emptied, opened, a_run, an_estimate):
    """The server, and a writer that is connected to it and has filed the first of 299 estimates."""
    entry = a_run(uuid="5eed")
    history = opened(emptied.url)
    number = history.start_run(entry)
    history.close()
    writer = HistoryWriter(lambda: open_history(emptied.url, write=True), entry)
    writer.enqueue(an_estimate(number, number=1))
    wait_until(lambda: writer.filed)

    def fail():
        for n in range(2, 300):
            writer.enqueue(an_estimate(number, number=n))
        wait_until(lambda: writer.failure is not None)

    yield emptied, writer, fail
    writer.end(lambda history, run: history.end_run(run, "completed", None, 299), ENOUGH)
    assert (writer.complete, writer.filed, writer.failure) == (True, 299, None)
    assert opened(emptied.url).filed(number) == 299


def test_a_restarted_server_gets_what_it_missed(connected):
    server, writer, fail = connected
    server.stop()
    fail()
    assert "\n" not in writer.failure
    server.start()


def test_a_server_that_stops_answering_is_cut_off_and_tried_again(connected, opened, capfd):
    """Its own time-outs are worth nothing then: the client cuts the connection."""
    server, writer, fail = connected
    with server.hung():
        fail()
        assert "no answer for 12 s" in writer.failure or "timeout" in writer.failure
        assert writer.filed == 1
        with pytest.raises(StagectlError, match="timeout"):  # what a run would begin with
            opened(server.url)
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
