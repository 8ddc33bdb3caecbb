"""Filing what a history lacks, from the notes of recordings: once, for runs that may lack some."""

import json
from pathlib import Path

import pytest

from stagectl.errors import UnusableInput
from stagectl.history import (
    EstimateRecord,
    StageKey,
    StepRecord,
    note_of_estimate,
    note_of_run,
)
from stagectl.history.filing import recorded_run
from stagectl.store import RunNotes
from tests.unit.stagectl.rows import BEGIN, STAGE, run_entry

PATH = Path("recording.h5")
ENTRY = run_entry(wafer=None, purpose="calibration", seed=3, uuid="5eed", operator="me")
ESTIMATE = EstimateRecord(
    0, "y", "micro", 2, (0.0, -0.01), 1.7e9 + 5.5, -3e-5, False, "too short",
    {"coulomb": 9.0}, (0.01,), 1.002, (8.9, 0.05), 21.5, 1,
)  # fmt: skip


def events(**changes):
    """As a journal keeps them: JSON."""
    run = {"event": "run", "history": note_of_run(ENTRY, "/runs/stage.db"), **changes}
    friction = {
        "event": "friction", "axis": "y", "site": 2, "accepted": False, "reason": "too short",
        "record": note_of_estimate(ESTIMATE),
    }  # fmt: skip
    step = {
        "event": "level_stepped", "axis": "x", "place": [0.02, 0.0], "time": 7.0, "change": 0.2,
        "everywhere": True,
    }  # fmt: skip
    return tuple(json.loads(json.dumps(e)) for e in (run, friction, step))


def notes(outcome="completed", entries=None):
    return RunNotes("", "", "", outcome, events() if entries is None else entries)


def test_run_estimates_and_steps_come_back_as_they_were():
    found = recorded_run(notes(), PATH)
    assert found.entry == ENTRY
    assert (found.entry.uuid, found.entry.operator) == ("5eed", "me")
    assert found.where == "/runs/stage.db"
    assert found.estimates == (ESTIMATE,)
    assert found.estimates[0].number == 1
    (step,) = found.steps
    assert (step.kind, step.change, step.time, step.number) == ("common", 0.2, 1.7e9 + 7.0, 1)


@pytest.mark.parametrize(
    ("outcome", "filed"),
    [("completed", "completed"), ("fault", "fault"), ("killed", None), ("", None)],
)
def test_a_killed_run_has_no_outcome(outcome, filed):
    assert recorded_run(notes(outcome), PATH).outcome == filed


def test_an_older_recording_lacks_the_records():
    without = tuple({k: v for k, v in e.items() if k != "history"} for e in events())
    for entries in (without, ()):
        with pytest.raises(UnusableInput, match="lacks the records that a history needs"):
            recorded_run(notes(entries=entries), PATH)


def test_damage_is_one_line():
    run, friction, step = events()
    for broken in ({**friction, "record": {}}, {**friction, "record": None}):
        with pytest.raises(UnusableInput, match=r"^recording\.h5: /events: damaged \("):
            recorded_run(notes(entries=(run, broken, step)), PATH)


def test_filing_again_adds_nothing(where, opened, a_run, an_estimate):
    """After a connection was lost nobody knows whether the last rows got through."""
    history = opened(where)
    run = a_run(uuid="5eed")
    number = history.start_run(run)
    assert history.start_run(run) == number != history.start_run(a_run(uuid="0ther"))
    history.add([an_estimate(number, number=1)])
    history.add([an_estimate(number, number=n, time=BEGIN + n) for n in (1, 2, 3)])
    step = StepRecord(number, "x", (0.01, -0.02), BEGIN + 2.0, 0.1, "site", number=1)
    history.add_step(step)
    history.add_step(step)
    assert history.filed(number) == 3
    assert history.at_date(STAGE, BEGIN + 1.5)[0].time == BEGIN + 1.0  # as it was
    assert history.steps(STAGE) == [step]


def test_runs_with_estimates_that_may_be_missing_are_listed(where, opened, a_run):
    history = opened(where)
    runs = {name: history.start_run(a_run(uuid=name, folder=f"runs/{name}")) for name in "abcd"}
    history.start_run(a_run(StageKey("another", True), uuid="e"))
    history.start_run(a_run())  # of an older version: nobody could tell which files are its own
    history.end_run(runs["a"], "completed", estimates=7)
    history.end_run(runs["b"], None, estimates=2)  # killed, and filed since
    history.end_run(runs["c"], "fault", "axis x: ...")
    assert history.unfiled(STAGE) == [("d", "runs/d"), ("c", "runs/c")]
    assert history.unfiled(STAGE, last=1) == [("d", "runs/d")]
    outcomes = {number: outcome for number, _, outcome in history.runs(STAGE)}
    assert [outcomes[runs[name]] for name in "abcd"] == ["completed", None, "fault", None]
