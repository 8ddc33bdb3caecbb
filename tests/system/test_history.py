"""A run's friction estimates in the history: all of them, once, with what they belong to."""

import contextlib
import math
import threading
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from stagectl.config.machine.file import parse_machine
from stagectl.errors import StagectlError, UnusableInput
from stagectl.history import StageKey, file_unfiled_runs, open_history, runs_in
from stagectl.recipe import parse_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.run.record import RunRecord
from stagectl.sequencer import FrictionUpdated, LevelStepped, Mode
from tests.short_recipe import short_recipe
from tests.sqlite_lock import locked
from tests.waiting import wait_until

SHORT = short_recipe((0.01, 0.0), (0.02, 0.01)) + "lot: L42\nwafer: 7\n"
STAGE = StageKey("wafer-xy", True)


@pytest.fixture
def request_(machine, tmp_path):
    return RunRequest(
        parse_recipe(SHORT, "short.yaml", machine),
        machine,
        tmp_path / "run",
        datetime.now(UTC),
        simulated=SimulatedStage(machine),
        history=str(tmp_path / "stage.db"),
    )


def test_every_estimate_of_a_run_is_in_the_history(request_, tmp_path):
    # The reading of the kp object stands for a thermometer: 341,000 counts of 1e-4 deg C.
    text = request_.machine.text + (
        'temperature: {axis: x, object: "0x2000:01", scale: 1.0e-4, offset: -10.0}\n'
    )
    warm = replace(request_, machine=parse_machine(text, "warm"))
    summary = execute(warm, Listener()).summary
    history = open_history(request_.history)
    ((number, run, outcome),) = history.runs(STAGE)
    assert (run.recipe, run.lot, run.wafer, run.seed, outcome) == (
        "short", "L42", "7", 1, "completed"
    )  # fmt: skip
    assert run.software.startswith("stagectl ")
    assert run.started == pytest.approx(request_.started.timestamp())
    accepted = [e for e in summary["friction"] if e["accepted"]]
    assert history.counted(STAGE) == (len(accepted), len(summary["friction"]) - len(accepted))
    assert len(accepted) >= 6
    assert history.places(STAGE) == [(0.01, 0.0), (0.02, 0.01)]
    for row in history.at_date(STAGE, math.inf):
        last = [e for e in accepted if (e["axis"], e["site"]) == (row.axis, row.site)][-1]
        figure = last["parameters"]["coulomb"]
        assert row.figures["coulomb"] == figure["value"]
        assert row.sigma("coulomb") == pytest.approx(figure["sigma"])
        assert 0.0 < row.time - run.started <= summary["duration"] + 1e-6  # a float's resolution
        assert row.temperature == pytest.approx(24.1, abs=0.1)
        assert row.run == number
    history.close()


def test_a_history_that_cannot_be_used_is_refused_before_anything_moves(request_, tmp_path):
    (tmp_path / "stage.db").write_text("my notes\n" * 1000)
    with pytest.raises(UnusableInput, match="not an SQLite file"):
        execute(request_, Listener())
    assert not list((tmp_path / "run").glob("*"))
    assert (tmp_path / "stage.db").read_text() == "my notes\n" * 1000


def rows(history):
    """All that is stored of a stage's estimates and steps."""
    return [
        [replace(e, run=0) for e in sorted(found, key=lambda e: (e.time, e.axis))]
        for found in (history.at_date(STAGE, math.inf), history.refused(STAGE))
    ], history.steps(STAGE)


def test_a_run_goes_on_beside_a_history_that_is_locked(request_, tmp_path, stagectl):
    """To its end; what is missing is filed from its folder, once, the same as without a lock."""
    made = []
    with contextlib.ExitStack() as stack:

        def note(event):
            if isinstance(event, FrictionUpdated):
                if not made:
                    stack.enter_context(locked(request_.history))
                made.append(event)

        result = execute(request_, Listener(event=note))
        assert result.summary["outcome"] == "completed"
        filed = result.summary["history"]["filed"]
        assert result.summary["history"]["estimates"] == len(made) > 5
        assert filed < len(made)
        assert result.unwritten in result.notices
        assert f"{filed} of {len(made)} estimates in the history" in result.unwritten
        assert "another program is writing to it" in result.unwritten
        command = f"history import {request_.folder}"
        assert f"'stagectl {command}'" in result.unwritten
        refused = stagectl(*command.split())
        assert refused.returncode == 1
        assert "another program" in refused.stderr
    first, again = stagectl(*command.split()), stagectl(*command.split())
    assert first.stdout.startswith(f"{len(made) - filed} of {len(made)} estimates imported into ")
    assert again.stdout.startswith(f"all {len(made)} estimates are already in ")
    other = replace(request_, folder=tmp_path / "other", history=str(tmp_path / "other.db"))
    execute(replace(other, started=request_.started), Listener())
    imported, written = open_history(request_.history), open_history(other.history)
    ((_, run, outcome),) = imported.runs(STAGE)
    assert (run.folder, outcome) == (str(request_.folder), "completed")
    assert sum(imported.counted(STAGE)) == len(made)
    assert rows(imported) == rows(written)
    assert imported.unfiled(STAGE) == written.unfiled(STAGE) == []
    imported.close()
    written.close()


def test_a_run_beside_a_server_that_hangs_and_the_next_one_that_files_it(request_, server):
    url = server.url
    with contextlib.ExitStack() as stack:
        made = []

        def note(event):
            if isinstance(event, FrictionUpdated):
                if not made:
                    stack.enter_context(server.hung())
                made.append(event)

        result = execute(replace(request_, history=url), Listener(event=note))
        assert result.summary["outcome"] == "completed"
        assert result.summary["history"]["filed"] < len(made)
        for thread in threading.enumerate():  # an answer now would let it file the rest itself
            if thread.name == "history":
                thread.join()
    said = []
    execute(
        replace(request_, history=url, host=HostSettings(Mode.NONE)), Listener(phase=said.append)
    )
    assert any(line.endswith(f"an earlier run left in {request_.folder}") for line in said)
    history = open_history(url)
    assert sum(history.counted(STAGE)) == len(made)
    assert [outcome for *_, outcome in history.runs(STAGE)] == ["completed", "completed"]
    assert history.unfiled(STAGE) == []
    history.close()


def test_what_a_killed_run_left_in_its_journal_is_filed(request_, tmp_path):
    """As far as it got; the journal stays as it is, and a run that goes on is left alone."""
    events = []
    execute(replace(request_, history=None), Listener(event=events.append))
    estimates = [event for event in events if isinstance(event, FrictionUpdated)]
    history = open_history(request_.history, write=True)
    folders = alive, killed = tmp_path / "alive", tmp_path / "killed"
    journals = []
    for folder in folders:
        folder.mkdir()
        record = RunRecord(replace(request_, folder=folder), request_.started.timestamp())
        for event in estimates[:5]:
            record.note_event(event)
        record.note_event(LevelStepped("x", (0.01, 0.02), 0.5, 0.1, everywhere=False))
        record.start()  # enters the run; what it has noted before is in its journal alone
        journals.append(record.journal)
    journals[1].close()
    wait_until(lambda: {of for _, of in history.unfiled(STAGE)} == set(map(str, folders)))
    (line,) = file_unfiled_runs(history, STAGE)
    assert line == f"5 estimates filed that an earlier run left in {killed}"
    assert list(file_unfiled_runs(history, STAGE)) == []
    assert (sum(history.counted(STAGE)), len(history.steps(STAGE))) == (5, 1)
    assert [folder for _, folder in history.unfiled(STAGE)] == [str(alive)]
    assert {outcome for *_, outcome in history.runs(STAGE)} == {None}
    with pytest.raises(StagectlError, match="in progress"):
        runs_in(alive)
    journals[0].close()
    assert journals[1].path.exists()
    history.close()


def test_a_run_without_a_history_can_be_imported_into_one(request_, tmp_path, stagectl):
    summary = execute(replace(request_, history=None), Listener()).summary
    assert "history" not in summary
    refused = stagectl("history", "import", request_.folder)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "name one with --history" in refused.stderr
    where = tmp_path / "fleet.db"
    done = stagectl("history", "import", request_.folder, "--history", where)
    count = len(summary["friction"])
    assert done.stdout == f"{count} of {count} estimates imported into {where}\n"
    history = open_history(str(where))
    assert sum(history.counted(STAGE)) == count
    history.close()


def test_import_says_what_it_cannot_use(stagectl, tmp_path):
    (tmp_path / "empty").mkdir()
    foreign = Path(__file__).parents[1] / "data" / "null-1.h5"
    for path, reason in {
        tmp_path / "none": "no such folder", tmp_path / "empty": "holds no recording",
        foreign: "lacks the records",
    }.items():  # fmt: skip
        done = stagectl("history", "import", path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert reason in done.stderr
