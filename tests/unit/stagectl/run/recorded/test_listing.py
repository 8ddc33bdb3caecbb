"""Runs listed by what their folders hold: summary, recording, journal, or nothing readable."""

from dataclasses import replace

import pytest

from stagectl.config import load_machine
from stagectl.errors import UnusableInput
from stagectl.run import list_runs
from stagectl.store import Journal
from tests.unit.stagectl.run.whole import write_summary
from tests.unit.stagectl.store.journals import HEADER

RUN = {
    "history": {
        "recipe": "inspection", "stage": {"machine": "wafer-xy", "simulated": True}, "lot": "L1",
        "wafer": None,
    },
    "resumed": None, "simulated": True, "operator": "me", "comment": None, "unit": "site",
    "stretches": 20,
}  # fmt: skip


def journal(folder, done=0):
    folder.mkdir(parents=True)
    started = "2026-11-22T09:00:00+00:00"
    made = Journal(folder, replace(HEADER, machine=load_machine().text, started=started))
    made.event("run", **RUN)
    for number in range(1, done + 1):
        made.event("done", number=number, site=number)
    return made


def test_runs_come_in_the_order_of_their_beginning(tmp_path):
    write_summary(tmp_path / "a", started="2026-11-23T00:00:00+00:00")
    write_summary(tmp_path / "b")
    (tmp_path / "no run").mkdir()
    (tmp_path / "a file").write_text("")
    assert [run.folder.name for run in list_runs(tmp_path)] == ["b", "a"]


def test_a_runs_own_folder_is_that_run(tmp_path):
    (run,) = list_runs(write_summary(tmp_path / "a", lot="L1", limits={"verdict": "fail"}))
    assert (run.recipe, run.lot, run.wafer, run.outcome) == ("inspection", "L1", None, "completed")
    assert (run.verdict, run.unit, run.done, run.reason) == ("fail", None, None, None)


def test_an_interruption_says_how_far_and_why(tmp_path):
    stop = {"unit": "site", "done": 7, "of": 20, "reason": "stopped by the operator"}
    (run,) = list_runs(write_summary(tmp_path / "a", outcome="aborted", interrupted=stop))
    assert (run.unit, run.done, run.of, run.reason) == ("site", 7, 20, "stopped by the operator")
    (fault,) = list_runs(write_summary(tmp_path / "b", outcome="fault", fault="axis x: lost"))
    assert fault.reason == "axis x: lost"


def test_a_journal_is_of_a_run_in_progress_until_its_writer_is_gone(tmp_path):
    made = journal(tmp_path / "a", done=3)
    (run,) = list_runs(tmp_path)
    assert (run.outcome, run.done, run.of, run.operator) == ("running", 3, 20, "me")
    made.close()
    (run,) = list_runs(tmp_path)
    assert (run.outcome, run.started) == ("killed", "2026-11-22T09:00:00+00:00")


def test_the_journal_of_a_later_run_comes_before_the_summary_of_the_last_one(
    tmp_path,
):
    journal(tmp_path / "a").close()
    write_summary(tmp_path / "a")
    assert [run.outcome for run in list_runs(tmp_path)] == ["killed"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"recipe": 1}', "\udcff"])
def test_what_cannot_be_read_is_listed_with_its_reason(tmp_path, text):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "summary.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    (run,) = list_runs(tmp_path)
    assert run.outcome == "unreadable"
    assert str(tmp_path / "a" / "summary.json") in (run.reason or "")


def test_listing_changes_nothing(tmp_path):
    journal(tmp_path / "a").close()
    before = {path: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    list_runs(tmp_path)
    assert {path: path.read_bytes() for path in (tmp_path / "a").iterdir()} == before


def test_a_folder_that_there_is_not_is_one_line(tmp_path):
    with pytest.raises(UnusableInput, match=r"none: no such folder"):
        list_runs(tmp_path / "none")
