"""Runs listed by what their folders hold: summary, recording, journal, or nothing readable."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from stagectl.config import load_machine
from stagectl.errors import UnusableInput
from stagectl.run import list_runs
from stagectl.store import AxisScaling, Journal, JournalHeader

SUMMARY = {
    "recipe": "inspection", "machine": "wafer-xy", "simulated": True, "lot": "L1", "wafer": "W1",
    "outcome": "completed", "fault": None, "started": "2026-11-22T08:00:00+00:00",
}  # fmt: skip
RUN = {
    "history": {
        "recipe": "inspection", "stage": {"machine": "wafer-xy", "simulated": True}, "lot": "L1",
        "wafer": None,
    },
    "resumed": None, "simulated": True, "operator": "me", "comment": None, "unit": "site",
    "stretches": 20,
}  # fmt: skip


def summary(folder: Path, **changes: Any) -> Path:
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text(json.dumps({**SUMMARY, **changes}))
    return folder


def journal(folder: Path, done: int = 0) -> Journal:
    folder.mkdir(parents=True)
    scaling = (AxisScaling("x", 1e-9, 0.04), AxisScaling("y", 1e-9, 0.06))
    header = JournalHeader(load_machine().text, "", "2026-11-22T09:00:00+00:00", scaling)
    made = Journal(folder, header)
    made.event("run", **RUN)
    for number in range(1, done + 1):
        made.event("done", number=number, site=number)
    return made


def test_runs_come_in_the_order_of_their_beginning(tmp_path: Path) -> None:
    summary(tmp_path / "a", started="2026-11-23T00:00:00+00:00")
    summary(tmp_path / "b")
    (tmp_path / "no run").mkdir()
    (tmp_path / "a file").write_text("")
    assert [run.folder.name for run in list_runs(tmp_path)] == ["b", "a"]


def test_a_runs_own_folder_is_that_run(tmp_path: Path) -> None:
    (run,) = list_runs(summary(tmp_path / "a", limits={"verdict": "fail"}))
    assert (run.recipe, run.lot, run.wafer, run.outcome) == ("inspection", "L1", "W1", "completed")
    assert (run.verdict, run.unit, run.done, run.reason) == ("fail", None, None, None)


def test_an_interruption_says_how_far_and_why(tmp_path: Path) -> None:
    stop = {"unit": "site", "done": 7, "of": 20, "reason": "stopped by the operator"}
    (run,) = list_runs(summary(tmp_path / "a", outcome="aborted", interrupted=stop))
    assert (run.unit, run.done, run.of, run.reason) == ("site", 7, 20, "stopped by the operator")
    (fault,) = list_runs(summary(tmp_path / "b", outcome="fault", fault="axis x: lost"))
    assert fault.reason == "axis x: lost"


def test_a_journal_is_of_a_run_in_progress_until_its_writer_is_gone(tmp_path: Path) -> None:
    made = journal(tmp_path / "a", done=3)
    (run,) = list_runs(tmp_path)
    assert (run.outcome, run.done, run.of, run.operator) == ("running", 3, 20, "me")
    made.close()
    (run,) = list_runs(tmp_path)
    assert (run.outcome, run.started) == ("killed", "2026-11-22T09:00:00+00:00")


def test_the_journal_of_a_later_run_comes_before_the_summary_of_the_last_one(
    tmp_path: Path,
) -> None:
    made = journal(tmp_path / "a")
    (tmp_path / "a" / "summary.json").write_text(json.dumps(SUMMARY))
    made.close()
    assert [run.outcome for run in list_runs(tmp_path)] == ["killed"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"recipe": 1}', "\udcff"])
def test_what_cannot_be_read_is_listed_with_its_reason(tmp_path: Path, text: str) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "summary.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    (run,) = list_runs(tmp_path)
    assert run.outcome == "unreadable"
    assert str(tmp_path / "a" / "summary.json") in (run.reason or "")


def test_listing_changes_nothing(tmp_path: Path) -> None:
    journal(tmp_path / "a").close()
    before = {path: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    list_runs(tmp_path)
    assert {path: path.read_bytes() for path in (tmp_path / "a").iterdir()} == before


def test_a_folder_that_there_is_not_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match=r"none: no such folder"):
        list_runs(tmp_path / "none")
