"""A run's estimates as rows of the history, and what is said where the history lacks some."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stagectl.errors import StagectlError
from stagectl.history import EstimateRecord, History, RunEntry, StageKey, open_history
from stagectl.run.checks import start_time
from stagectl.run.run_history import LOCAL, RunHistory
from stagectl.sequencer import FrictionUpdated, LevelStepped

BEGIN = 1.7e9
STAGE = StageKey("wafer-xy", True)
ENTRY = RunEntry(STAGE, ("x", "y"), BEGIN, "r", None, None, "stagectl", "/runs/a", uuid="5eed")


def updated(**changes: Any) -> FrictionUpdated:
    estimate = SimpleNamespace(
        accepted=True, reason=None, level=1.01, shown=(6.1, 0.03), zones="AB", misfit=0.5,
        expected=(6.0, 0.1), friction=SimpleNamespace(coulomb=6.05, viscous=20.0),
        figures={"coulomb": 6.05, "viscous": 20.0},
        sigma={"coulomb": 0.05, "viscous": 0.5}, covariance=np.array([[0.0025, 0.0], [0.0, 0.25]]),
    )  # fmt: skip
    known = {"site": 3, "axis": "x", "estimate": estimate, "compute_time": 6e-5, "kind": "macro",
             "place": (0.01, -0.02), "distance": 0.025, "time": 4.5, "reach": 0.025}  # fmt: skip
    return FrictionUpdated(**{**known, **changes})


def test_an_estimate_is_a_row_with_the_time_of_the_stage() -> None:
    history = RunHistory(ENTRY)
    row = history.estimate(updated(), temperature=21.5)
    assert (row.axis, row.kind, row.site, row.place) == ("x", "macro", 3, (0.01, -0.02))
    assert (row.time, row.distance, row.temperature) == (BEGIN + 4.5, 0.025, 21.5)
    assert row.figures == {"coulomb": 6.05, "viscous": 20.0}
    assert row.sigma("viscous") == pytest.approx(0.5)
    assert [row.number, history.estimate(updated()).number, history.made] == [1, 2, 2]


@pytest.mark.parametrize(
    ("reach", "placed", "counts"),
    [(0.025, False, False), (0.025, True, True), (LOCAL, False, True)],
)
def test_the_level_counts_for_the_place_where_the_whole_move_was_near_it_or_mapped(
    reach: float, placed: bool, counts: bool
) -> None:
    row = RunHistory(ENTRY).estimate(updated(reach=reach), placed)
    assert (row.measured is not None) is counts


def test_steps_are_numbered_on_their_own() -> None:
    history = RunHistory(ENTRY)
    history.estimate(updated())
    steps = [history.step(LevelStepped("x", (0.0, 0.01), 2.0, 0.2, all_)) for all_ in (False, True)]
    assert [(s.number, s.kind, s.time) for s in steps] == [
        (1, "site", BEGIN + 2.0), (2, "common", BEGIN + 2.0),
    ]  # fmt: skip


def test_without_a_history_nothing_is_missing() -> None:
    history = RunHistory(ENTRY)
    history.start()
    history.file(history.estimate(updated()))
    history.end("completed", None)
    assert (history.filed, history.unwritten(Path("/runs/a"))) == (0, None)


def test_all_that_is_handed_over_is_filed(tmp_path: Path) -> None:
    where = str(tmp_path / "stage.db")
    history = RunHistory(ENTRY, lambda: open_history(where, write=True))
    history.start()
    for _ in range(3):
        history.file(history.estimate(updated()))
    history.end("completed", None)
    assert (history.filed, history.unwritten(tmp_path)) == (3, None)
    opened = open_history(where)
    assert [outcome for _, _, outcome in opened.runs(STAGE)] == ["completed"]
    opened.close()


def test_what_the_history_lacks_is_said_with_the_reason_and_the_remedy(tmp_path: Path) -> None:
    def refuse() -> History:
        raise StagectlError("stage.db: the disk is full")

    history = RunHistory(ENTRY, refuse)
    history.start()
    records: list[EstimateRecord] = [history.estimate(updated()) for _ in range(2)]
    for record in records:
        history.file(record)
    assert history.unwritten(Path("/runs/a")) in (
        "0 of 2 estimates in the history (stage.db: the disk is full); "
        "'stagectl history import /runs/a' files the rest",
        "0 of 2 estimates in the history (it does not answer); "
        "'stagectl history import /runs/a' files the rest",
    )


def test_virtual_time_never_goes_back(tmp_path: Path) -> None:
    history = open_history(str(tmp_path / "stage.db"), write=True)
    now = datetime.fromtimestamp(BEGIN, UTC)

    def start(truth: Any) -> float:
        machine = SimpleNamespace(name="wafer-xy")
        return start_time(history, SimpleNamespace(started=now, truth=truth, machine=machine))  # type: ignore[arg-type]

    assert start("a virtual stage") == BEGIN
    number = history.start_run(ENTRY)
    row = RunHistory(ENTRY).estimate(updated(time=5000.0))
    history.add([replace(row, run=number)])
    assert start("a virtual stage") == pytest.approx(BEGIN + 5001.0)
    assert start(None) == BEGIN
    history.close()
