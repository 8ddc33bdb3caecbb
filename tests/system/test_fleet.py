"""Fleets as users start them: from an object store, interrupted, on a cluster that is shot at."""

import json
import signal
import time

import pyarrow.parquet as pq
import pytest

from benchmarks.fleet.campaign import make_recordings, run_chaos
from tests.command import stagectl
from tests.processes import start

SOON_OVER = 625
"""Samples of a recording that is too short for a diagnosis, which says so at once."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Three, one of them damaged."""
    folder = tmp_path_factory.mktemp("fleet") / "recordings"
    make_recordings(folder, 3, damaged=1, samples=SOON_OVER)
    return folder


@pytest.fixture
def bucket(recordings, monkeypatch):
    """A bucket with the recordings."""
    import s3fs  # slow to import, and only here
    from moto.server import ThreadedMotoServer

    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    store = s3fs.S3FileSystem(skip_instance_cache=True)
    store.mkdir("fab")
    store.put(str(recordings), "fab/recordings", recursive=True)
    yield store
    server.stop()


@pytest.mark.slow
def test_recordings_of_an_object_store_are_diagnosed_once(bucket):
    command = ["fleet", "diagnose", "s3://fab/recordings", "--out", "s3://fab/fleet"]
    said = stagectl(*command, "--workers", "1", "--json", "-")
    assert said.returncode == 0, said.stderr
    report = json.loads(said.stdout)
    assert (report["recordings"], report["diagnosed"], report["complete"]) == (3, 2, True)
    ((damaged, reason),) = report["refused"].items()
    assert damaged == "s3://fab/recordings/0000.h5"
    assert "damaged or truncated" in reason
    again = json.loads(stagectl(*command, "--json", "-").stdout)
    assert (again["diagnosed"], again["reused"], again["refused"]) == (0, 2, report["refused"])
    said = stagectl("fleet", "summary", "s3://fab/fleet")
    assert said.returncode == 0, said.stderr
    assert "wafer-xy" in said.stdout
    assert bucket.exists("fab/fleet/summary.html")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "--out", "out"], "nowhere: no such file"),
        (["s4://fab", "--out", "out"], "s4://fab: "),
        (
            [__file__, "--out", "out", "--scheduler", "tcp://127.0.0.1:9"],
            "--scheduler tcp://127.0.0.1:9: no scheduler answers",
        ),
        ([__file__, "--out", "out", "--scheduler", "a", "--workers", "2"], "--workers: a cluster"),
        ([__file__, "--out", __file__], "is a file, not a folder"),
        ([__file__, "--out", "out", "--history", "none.db"], "none.db: no such history"),
    ],
)
def test_bad_input_is_one_line(arguments, words, tmp_path):
    said = stagectl("fleet", "diagnose", *arguments, cwd=tmp_path)
    assert said.returncode == 2
    assert words in said.stderr
    assert said.stderr.count("\n") == 1


def results(out):
    return {path: path.stat().st_mtime_ns for path in out.glob("results/*/*.parquet")}


@pytest.mark.slow
def test_ctrl_c_leaves_what_is_finished_and_the_command_continues(tmp_path):
    make_recordings(tmp_path / "recordings", 3)
    out = tmp_path / "fleet"
    command = ["fleet", "diagnose", tmp_path / "recordings", "--out", out, "--workers", "1"]
    with start(*command, "--json", "-") as first:
        while not results(out) and first.poll() is None:
            time.sleep(0.05)
        first.send_signal(signal.SIGINT)
        text, said = first.communicate(timeout=120)
    assert first.returncode == 130
    assert said.splitlines() == ["stopped; the same command continues"]
    report = json.loads(text)
    assert not report["complete"]
    assert stagectl("fleet", "summary", out).returncode == 0
    before = results(out)
    rest = json.loads(stagectl(*command, "--json", "-").stdout)
    assert rest["diagnosed"] + rest["reused"] == 3
    assert rest["reused"] >= report["diagnosed"]
    assert results(out).items() >= before.items()


@pytest.mark.slow
def test_killed_workers_scheduler_and_client_change_nothing(tmp_path):
    make_recordings(tmp_path / "recordings", 6, damaged=1)
    found = run_chaos(tmp_path / "recordings", tmp_path, seed=1)
    assert found.killed > 0
    assert (found.exit_code, found.diagnosed, found.refused) == (0, 5, 1)
    assert (found.rewritten, found.same) == (0, True)
    ledger = pq.read_table(tmp_path / "out-chaos" / "recordings.parquet").to_pylist()
    assert all(of["result"] for of in ledger)
    assert len(ledger) == 6
