"""stage.db as a file: what else may stand in its place, migrations, and death at any instant."""

import contextlib
import os
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

from stagectl.errors import StagectlError, UnusableInput
from stagectl.history import StageKey, database, open_history
from stagectl.history.schema import MIGRATIONS, READABLE
from tests.unit.stagectl.rows import STAGE


@pytest.mark.parametrize("write", [True, False])
def test_other_files_are_refused(tmp_path, write):
    text = tmp_path / "notes.db"
    text.write_text("not a database at all, but long enough to be looked at\n" * 30)
    foreign = tmp_path / "foreign.db"
    with contextlib.closing(sqlite3.connect(foreign)) as connection:
        connection.execute("CREATE TABLE something (x)")
    newer = tmp_path / "newer.db"
    open_history(str(newer), write=True).close()
    with contextlib.closing(sqlite3.connect(newer)) as connection:
        connection.execute(f"PRAGMA user_version = {len(MIGRATIONS) + 1}")
    for path, reason in (
        (text, "not an SQLite file"), (foreign, "not a history"), (newer, "newer stagectl"),
        (tmp_path, "is a folder"),
    ):  # fmt: skip
        before = path.read_bytes() if path.is_file() else b""
        with pytest.raises(UnusableInput, match=reason):
            open_history(str(path), write)
        assert not path.is_file() or path.read_bytes() == before
    with pytest.raises(UnusableInput if not write else StagectlError):
        open_history(str(tmp_path / "nowhere" / "stage.db"), write)


ROWS = """
INSERT INTO stage VALUES (1, 'wafer-xy', 1);
INSERT INTO stage_axis VALUES (1, 'x');
INSERT INTO run (stage, purpose, started, recipe, software, folder)
    VALUES (1, 'production', 1.7e9, 'r', 's', 'f');
INSERT INTO place VALUES (1, 1, 0, 0);
INSERT INTO estimate (run, place, axis, kind, time, distance, accepted, figures, covariance, level)
    VALUES (1, 1, 'x', 'macro', 1.7e9, 0.01, 1, '{"coulomb": 6.0}', zeroblob(8), 1.0);
"""


def test_every_older_version_is_migrated(tmp_path, monkeypatch):
    for version in range(1, len(MIGRATIONS) + 1):
        path = str(tmp_path / f"{version}.db")
        with monkeypatch.context() as old:
            old.setattr(database, "MIGRATIONS", MIGRATIONS[:version])
            open_history(path, write=True).close()
        with contextlib.closing(sqlite3.connect(path)) as connection:
            connection.executescript(ROWS)
        if version < READABLE:
            with pytest.raises(UnusableInput, match="open it once for writing"):
                open_history(path)
        else:
            before = open_history(path)
            assert len(before.measurements(STAGE, each=1)) == 0
            assert len(before.at_date(STAGE, 1.8e9)) == 1
            assert len(before.runs(STAGE)) == 1
            before.close()
        history = open_history(path, write=True)
        assert history.counted(STAGE) == (1, 0)
        assert history.unfiled(STAGE) == []  # nothing is known of its files
        history.close()
        open_history(path).close()


def test_reading_leaves_no_files_beside_a_history_nor_needs_to_write_there(tmp_path, a_run):
    """Kept on a share, say; who may write anywhere, root, sees nothing of it."""
    kept = tmp_path / "kept"
    kept.mkdir()
    path = kept / "stage.db"
    history = open_history(str(path), write=True)
    history.start_run(a_run())
    history.close()
    before = path.read_bytes()
    for mode in (0o755, 0o555):
        kept.chmod(mode)
        path.chmod(mode & 0o666)
        try:
            read = open_history(str(path))
            assert len(read.stages()) == 1
            with pytest.raises(StagectlError):
                read.start_run(a_run())
            read.close()
            if mode == 0o755 or not os.access(kept, os.W_OK):
                assert [entry.name for entry in kept.iterdir()] == ["stage.db"]
        finally:
            kept.chmod(0o755)
    assert path.read_bytes() == before


def test_a_server_that_cannot_be_reached_is_no_history(tmp_path):
    pytest.importorskip("psycopg")
    with pytest.raises(UnusableInput, match=r"postgresql://127\.0\.0\.1:1/stage"):
        open_history("postgresql://lab@127.0.0.1:1/stage")


WRITER = """
import sys
sys.path.insert(0, {tests!r})
from stagectl.history.opening import open_history
from stagectl.history.records import EstimateRecord, RunEntry, StageKey
sys.stdout.write("up\\n")
sys.stdout.flush()
history = open_history({path!r}, write=True)
run = history.start_run(
    RunEntry(StageKey("m", False), ("x", "y"), 0.0, "r", None, None, "s", "f"))
i = 0
while True:
    history.add([
        EstimateRecord(run, axis, "macro", i, (i % 7 * 1e-3, 0.0), float(i), 0.01, True, None,
                       {{"coulomb": 1.0 + i}}, (0.01,)) for axis in "xy"])
    sys.stdout.write(f"{{run}} {{i}}\\n")
    sys.stdout.flush()
    i += 1
"""


def test_a_kill_at_any_instant_loses_no_commit(tmp_path):
    path = str(tmp_path / "stage.db")
    command = [sys.executable, "-c", WRITER.format(path=path, tests=".")]
    stage = StageKey("m", False)
    promised: dict[int, int] = {}
    for attempt in range(6):
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            first = writer.stdout.readline()
            assert first == "up\n"  # from here at any instant, the file's making included
            if attempt >= 3:
                first = writer.stdout.readline()
            time.sleep(0.007 * attempt)
            os.kill(writer.pid, signal.SIGKILL)
            lines = (first + writer.stdout.read()).splitlines(keepends=True)
        lines = [line for line in lines if line.endswith("\n") and " " in line]
        if lines:
            run, last = map(int, lines[-1].split())
            promised[run] = last
        if not (tmp_path / "stage.db").exists():
            continue
        history = open_history(path, write=True)
        history.close()
        with contextlib.closing(sqlite3.connect(path)) as connection:
            assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            rows = dict(connection.execute("SELECT run, max(site) FROM estimate GROUP BY run"))
            pairs = connection.execute(
                "SELECT run, site, count(*) FROM estimate GROUP BY run, site HAVING count(*) != 2"
            ).fetchall()
        assert pairs == []
        for run, last in promised.items():
            assert rows[run] >= last
    assert promised
    with contextlib.closing(open_history(path)) as history:
        assert history.counted(stage)[0] > 0
