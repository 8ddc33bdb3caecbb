"""What a run's record writes down, and what it makes of its journal in the end."""

import math

import pytest

from stagectl.errors import Aborted, RunFault
from stagectl.run.record import RunRecord
from stagectl.sequencer import Retrying, SegmentDone
from stagectl.store import read_journal_notes, read_notes
from tests.short_recipe import short_recipe
from tests.unit.stagectl.run.whole import SIMPLE, friction_updated, request_for


@pytest.fixture
def request_(machine, tmp_path):
    return request_for(machine, tmp_path, short_recipe((0.01, 0.0), (0.02, 0.0)))


@pytest.fixture
def record(request_):
    made = RunRecord(request_, 1.7e9)
    yield made
    made.journal.close()


def noted(record, name):
    events = read_journal_notes(record.journal.path, locked=False).events
    return [event for event in events if event["event"] == name]


def test_what_the_run_was_is_the_first_event(record, request_):
    (run,) = noted(record, "run")
    assert run["sample"] == 0
    assert {key: run[key] for key in request_.as_note()} == request_.as_note()
    assert (run["map"], run["effects"]) == (None, [])


def test_progress_is_counted_and_noted(record):
    for number in (1, 2):
        record.note_event(SegmentDone(number, number))
    record.note_event(Retrying(2, 1, 3, "axis y: 0x8611"))
    assert record.done == 2
    assert [event["number"] for event in noted(record, "done")] == [1, 2]
    (retry,) = noted(record, "retry")
    assert (retry["site"], retry["attempt"], retry["fault"]) == (2, 1, "axis y: 0x8611")


def test_a_limitation_is_noted_once(record):
    record.note_limitations(["no force offset", "no brake"])
    record.note_limitations(["no brake"])
    assert [event["text"] for event in noted(record, "limitation")] == [
        "no force offset", "no brake",
    ]  # fmt: skip


def test_attraction_is_rate_times_coulomb_force_and_so_is_its_uncertainty(record):
    record.note_event(friction_updated())
    (friction,) = noted(record, "friction")
    value, sigma = friction["parameters"]["attraction"]
    assert value == pytest.approx(600.0)
    assert sigma == pytest.approx(600.0 * math.hypot(0.3 / 6.0, 12.0 / 100.0))
    assert friction["gain"]["attraction"] == 0.5
    assert friction["held"] == ["attraction"]
    assert friction["compute_time"] is None  # JSON has no NaN


def test_a_law_without_presliding_has_fewer_figures(record):
    record.note_event(friction_updated(figures=SIMPLE))
    (friction,) = noted(record, "friction")
    assert set(friction["parameters"]) == {"coulomb", "viscous"}


@pytest.mark.parametrize(
    ("error", "outcome"),
    [(None, "completed"), (Aborted("by the operator"), "aborted"), (RunFault("axis y"), "fault")],
)
def test_a_run_that_never_moved_has_a_summary_and_no_recording(record, request_, error, outcome):
    result = record.finish(error)
    assert result.summary["outcome"] == outcome
    assert result.summary["fault"] == ("axis y" if outcome == "fault" else None)
    assert (result.recording, result.error) == (None, error)
    assert (request_.folder / "summary.json").exists()
    assert not (request_.folder / "recording.h5").exists()
    assert not record.journal.path.exists()


def test_the_first_move_after_an_accepted_estimate_is_told_from_those_before(record):
    record.note_event(friction_updated(accepted=False))
    record._moves = 3  # noqa: SLF001 (moves noted so far)
    record.note_event(friction_updated())
    record._moves = 5  # noqa: SLF001
    record.note_event(friction_updated())
    assert record.finish(None).first_update == {"x": 3}


def test_an_unforeseen_error_keeps_the_samples(record, request_):
    record.start()
    for k in range(12):
        record.journal.sink((k * 1_000_000, 0, 0, -1, *(0, 0, 0, 0, 0x1237, 1, 200_000, 0) * 2))
    record.abandon()
    notes = read_notes(request_.folder / "recording.h5")
    assert (notes.outcome, notes.fault) == ("fault", "internal error")
    assert not record.journal.path.exists()
