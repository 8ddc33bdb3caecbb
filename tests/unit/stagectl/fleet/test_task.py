"""The work on one recording can be done any number of times, and leaves one row."""

import json
import shutil
from dataclasses import replace

import h5py
import pytest

from stagectl.fleet.rows import REFUSED, RESULT, from_parquet, to_parquet
from stagectl.fleet.task import diagnose_one
from stagectl.history import note_of_estimate, note_of_run
from stagectl.store import RunNotes, read_recording, write_recording
from tests.unit.stagectl.rows import estimate_record, run_entry


def row_of(folder, done):
    (row,) = from_parquet(folder.read([done.result])[done.result], RESULT)
    return row


def test_a_row_has_what_the_diagnosis_says(small, folder, job):
    done = diagnose_one(job(small))
    row = row_of(folder, done)
    assert (row["recording"], row["content"], row["stage"]) == (
        str(small),
        done.content,
        "wafer-xy",
    )
    assert (row["verdict"], row["causes"], row["channels"]) == ("no_gap", [], [])
    assert row["started"].isoformat() == "2026-11-02T08:00:00+00:00"
    report = json.loads(row["report"])
    assert report["recordings"] == [str(small)]
    assert report["reason"] == row["reason"]
    gaps = {(of["axis"], of["signal"]): of["gap"] for of in row["gap"]}
    assert gaps["y", "force"] == report["gap"]["y"]["force"]["nominal"]
    assert 0.0 < row["floors"] < 1.5
    assert row["machine"] == read_recording(small).machine


def test_what_exists_is_not_computed_again(small, folder, job, tmp_path):
    first = diagnose_one(job(small))
    marked = row_of(folder, first) | {"reason": "as it was"}
    folder.write(first.result, to_parquet([marked], RESULT))
    same = tmp_path / "copy.h5"
    shutil.copy(small, same)
    again = diagnose_one(job(same))
    assert (first.reused, again.reused, again.result) == (False, True, first.result)
    assert row_of(folder, again)["reason"] == "as it was"


def test_a_result_is_named_by_content_machine_file_options_and_version(job):
    of = job("1.h5")
    others = [
        of.result("b"),
        replace(of, machine=("machine: {}", "M.yaml")).result("a"),
        replace(of, correct=True).result("a"),
        replace(of, version="stagectl 9").result("a"),
    ]
    assert len({of.result("a"), *others}) == 5
    assert replace(of, url="2.h5", stamp="2").result("a") == of.result("a")


def spoil_machine(path):
    with h5py.File(path, "r+") as file:
        file.attrs["machine"] = "machine: {name: 3}\n"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:20_000]), "damaged or truncated"),
        (spoil_machine, "machine:1:10: machine: must be a text"),
    ],
)
def test_a_recording_that_cannot_be_used_is_a_row_with_its_reason(
    small, folder, job, tmp_path, spoil, words
):
    path = tmp_path / "spoilt.h5"
    shutil.copy(small, path)
    spoil(path)
    done = diagnose_one(job(path))
    row = row_of(folder, done)
    assert (row["verdict"], row["reason"]) == (REFUSED, done.refusal)
    assert words in done.refusal
    assert diagnose_one(job(path)) == replace(done, reused=True)


def estimate(value, **other):
    record = estimate_record(0, figures={"coulomb": value}, covariance=(0.04,), **other)
    return {
        "event": "friction", "axis": record.axis, "site": record.site,
        "accepted": record.accepted, "reason": record.reason, "record": note_of_estimate(record),
    }  # fmt: skip


def test_friction_that_a_run_has_accepted_last_is_in_its_row(small, folder, job, tmp_path):
    recording = read_recording(small)
    events = (
        {"event": "run", "history": note_of_run(run_entry(lot="L7"), None)},
        estimate(5.0),
        estimate(6.0),
        estimate(7.0, accepted=False, reason="too short"),
        estimate(8.0, axis="y"),
    )
    path = tmp_path / "run.h5"
    write_recording(recording, path, notes=RunNotes("", "", "", "completed", events))
    row = row_of(folder, diagnose_one(job(path)))
    assert row["friction"] == [
        {"axis": "x", "coulomb": 6.0, "sigma": pytest.approx(0.2)},
        {"axis": "y", "coulomb": 8.0, "sigma": pytest.approx(0.2)},
    ]
    assert (row["simulated"], row["recipe"], row["lot"]) == (True, "r", "L7")


def test_another_version_of_the_program_does_nothing(small, folder, job):
    with pytest.raises(RuntimeError, match="stagectl 9 asks"):
        diagnose_one(job(small, version="stagectl 9"))
    assert folder.names("results") == set()
