"""A run's estimates as rows of the history, and what is said where the history lacks some."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from stagectl.errors import StagectlError
from stagectl.history import open_history
from stagectl.run.checks import start_time
from stagectl.run.run_history import LOCAL, RunHistory
from stagectl.sequencer import LevelStepped
from tests.unit.stagectl.rows import BEGIN, run_entry
from tests.unit.stagectl.run.whole import SIMPLE, friction_updated

ENTRY = run_entry(uuid="5eed")


def test_an_estimate_is_a_row_with_the_time_of_the_stage():
    history = RunHistory(ENTRY)
    row = history.estimate(friction_updated(figures=SIMPLE), temperature=21.5)
    assert (row.axis, row.kind, row.site, row.place) == ("x", "macro", 1, (0.01, 0.0))
    assert (row.time, row.distance, row.temperature) == (BEGIN + 1.5, 0.01, 21.5)
    assert row.figures == {"coulomb": 6.0, "viscous": 20.0}
    assert row.sigma("viscous") == pytest.approx(1.0)
    again = history.estimate(friction_updated()).number
    assert [row.number, again, history.made] == [1, 2, 2]


@pytest.mark.parametrize(
    ("reach", "placed", "counts"),
    [(0.025, False, False), (0.025, True, True), (LOCAL, False, True)],
)
def test_the_level_counts_for_the_place_where_the_whole_move_was_near_it_or_mapped(
    reach, placed, counts
):
    row = RunHistory(ENTRY).estimate(friction_updated(reach=reach), placed)
    assert (row.measured is not None) is counts


def test_steps_are_numbered_on_their_own():
    history = RunHistory(ENTRY)
    history.estimate(friction_updated())
    steps = [history.step(LevelStepped("x", (0.0, 0.01), 2.0, 0.2, all_)) for all_ in (False, True)]
    assert [(s.number, s.kind, s.time) for s in steps] == [
        (1, "site", BEGIN + 2.0), (2, "common", BEGIN + 2.0),
    ]  # fmt: skip


def test_without_a_history_nothing_is_missing():
    history = RunHistory(ENTRY)
    history.start()
    history.file(history.estimate(friction_updated()))
    history.end("completed", None)
    assert (history.filed, history.unwritten(Path("/runs/a"))) == (0, None)


def test_what_the_history_lacks_is_said_with_the_reason_and_the_remedy():
    def refuse():
        raise StagectlError("stage.db: the disk is full")

    history = RunHistory(ENTRY, refuse)
    history.start()
    for record in [history.estimate(friction_updated()) for _ in range(2)]:
        history.file(record)
    assert history.unwritten(Path("/runs/a")) in [
        f"0 of 2 estimates in the history ({reason}); "
        "'stagectl history import /runs/a' files the rest"
        for reason in ("stage.db: the disk is full", "it does not answer")
    ]


def test_virtual_time_never_goes_back(tmp_path):
    history = open_history(str(tmp_path / "stage.db"), write=True)
    now = datetime.fromtimestamp(BEGIN, UTC)

    def start(truth):
        machine = SimpleNamespace(name="wafer-xy")
        return start_time(history, SimpleNamespace(started=now, truth=truth, machine=machine))

    assert start("a virtual stage") == BEGIN
    number = history.start_run(ENTRY)
    row = RunHistory(ENTRY).estimate(friction_updated(time=5000.0))
    history.add([replace(row, run=number)])
    assert start("a virtual stage") == pytest.approx(BEGIN + 5001.0)
    assert start(None) == BEGIN
    history.close()
