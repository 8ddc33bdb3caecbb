"""Recordings made of journals: of finished, killed and damaged runs."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from stagectl.errors import StagectlError, UnusableInput
from stagectl.store import (
    Journal,
    read_ledger,
    read_recording,
    recording_in,
    recover_journal,
    recover_left_over,
)
from stagectl.store.journal import encode_header
from tests.unit.stagectl.store.journals import HEADER, move, written


def test_a_finished_run_becomes_a_recording(tmp_path):
    journal = written(tmp_path)
    assert journal.samples == 30
    journal.move(move("micro", 20, 25))  # broken off: replaces what was announced
    journal.finish("aborted")
    recovered = recover_journal(journal.path, overwrite=True)
    assert recovered.path == tmp_path / "recording.h5"
    assert not journal.path.exists()
    recording = read_recording(recovered.path)
    np.testing.assert_allclose(recording.time, np.arange(30) * 1e-3, rtol=0, atol=1e-15)
    x, y = recording.axes["x"], recording.axes["y"]
    np.testing.assert_allclose(x.position_demand, -np.arange(30) * 1e-9, rtol=1e-15)
    np.testing.assert_allclose(x.position_actual, (1 - np.arange(30)) * 1e-9, rtol=1e-15)
    np.testing.assert_allclose(y.position_demand, np.arange(30) * 2e-8, rtol=1e-15)
    assert set(x.force_offset) == {25 * 0.04}
    assert set(x.force_actual) == {-26 * 0.04}
    assert set(y.statusword) == {0x1237}
    assert list(np.flatnonzero(~y.valid)) == [9, 19, 29]
    assert recording.moves == (move("macro", 3, 12), move("micro", 20, 25))
    assert (recording.machine, recording.recipe) == (HEADER.machine, HEADER.recipe)
    ledger = read_ledger(recovered.path)
    assert (ledger.missed_per_cycle.sum(), ledger.late.sum(), ledger.late_in_a_row) == (3, 1, 1)
    assert list(np.flatnonzero(ledger.missed_per_cycle)) == [9, 19, 29]
    assert list(np.flatnonzero(np.isnan(ledger.arrival["y"]))) == [9, 19, 29]
    assert set(ledger.arrival["x"]) == {2e-4}
    assert list(np.flatnonzero(ledger.doubled_per_cycle)) == [5, 9]
    assert list(np.flatnonzero(ledger.tardy_per_cycle)) == [9]
    np.testing.assert_allclose(ledger.sync, 1e-8 * np.arange(30), rtol=1e-15)
    assert list(np.flatnonzero(np.isnan(ledger.doubt))) == [5]
    assert (ledger.doubled_per_cycle.sum(), ledger.tardy_per_cycle.sum()) == (2, 1)
    with h5py.File(recovered.path) as file:
        assert file.attrs["outcome"] == "aborted"
        events = [json.loads(text) for text in file["events"].asstr()]
    assert events[2] == {"event": "phase", "sample": 10, "number": 10}


KILLED_WRITER = """
import sys
from collections.abc import Callable
from pathlib import Path
from stagectl.store.journal import TEXT_TAG, AxisScaling, Journal, JournalHeader
axes = (AxisScaling("x", 1e-9, 0.04), AxisScaling("y", 1e-8, 0.06))
journal = Journal(Path(sys.argv[1]), JournalHeader("m", "", "t", axes))
k = 0
while True:
    journal.sink((k * 1000000, 0, 0, -1) + (k, 0, k, 0, 0, 1, 5, 0) * 2)
    k += 1
    if k % 1000 == 0:
        print(k, flush=True)
"""


def test_a_killed_process_loses_nothing_and_the_next_command_finds_it(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED_WRITER, str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[4],
    )
    reported = [int(process.stdout.readline()) for _ in range(3)]
    with pytest.raises(StagectlError, match="in progress"):
        recover_left_over(tmp_path)  # never takes the journal of a living run
    os.kill(process.pid, signal.SIGKILL)
    rest, _ = process.communicate()
    reported += [int(line) for line in rest.split()]
    recovered = recover_left_over(tmp_path)
    assert len(read_recording(recovered.path)) >= reported[-1]
    assert str(recovered.path) in recovered.describe()
    assert recover_left_over(tmp_path) is None


def test_the_folder_of_a_run_stands_for_its_recording(tmp_path):
    with pytest.raises(UnusableInput, match=r"holds no recording\.h5"):
        recording_in(tmp_path)
    journal = written(tmp_path)
    with pytest.raises(StagectlError, match="in progress"):
        recording_in(tmp_path)
    journal.close()
    with pytest.raises(UnusableInput, match=r"its run was killed; 'stagectl recover .*' makes"):
        recording_in(tmp_path)
    recover_journal(journal.path)
    assert recording_in(tmp_path) == tmp_path / "recording.h5"
    assert recording_in(tmp_path / "other.h5") == tmp_path / "other.h5"


def test_the_recording_of_another_run_is_kept(tmp_path):
    first = written(tmp_path, 5)
    first.finish("completed")
    recover_journal(first.path)
    second = written(tmp_path, 8)
    second.close()
    recovered = recover_journal(second.path)
    assert recovered.path == tmp_path / "recording-2.h5"
    assert len(read_recording(tmp_path / "recording.h5")) == 5
    third = written(tmp_path, 9)
    third.close()
    aside = recover_left_over(tmp_path, aside=True)
    assert aside.path == tmp_path / "recording-recovered.h5"


def test_a_kill_between_recording_and_removal_does_not_double_it(tmp_path):
    journal = written(tmp_path, 5)
    journal.close()
    data = journal.path.read_bytes()
    recover_journal(journal.path)
    journal.path.write_bytes(data)
    assert recover_journal(journal.path).path == tmp_path / "recording.h5"


def test_a_journal_without_samples_is_removed(tmp_path):
    journal = Journal(tmp_path, HEADER)
    journal.event("boot")
    journal.close()
    recovered = recover_journal(journal.path)
    assert recovered.path is None
    assert "without samples" in recovered.describe()
    assert list(tmp_path.iterdir()) == []


def test_other_files_are_refused_and_kept(tmp_path):
    path = tmp_path / "recording.journal"
    path.write_bytes(b"\x89HDF something else\n")
    with pytest.raises(UnusableInput, match="not a journal"):
        recover_journal(path)
    assert path.exists()
    path.write_bytes(b"stagectl-journal 4 {}\n")
    with pytest.raises(UnusableInput, match="header is damaged"):
        recover_journal(path)
    with pytest.raises(UnusableInput, match="No such file"):
        recover_journal(tmp_path / "absent.journal")


def test_a_journal_that_contradicts_itself_is_refused_and_kept(tmp_path):
    journal = written(tmp_path)
    journal.close()
    data = journal.path.read_bytes()
    other = replace(HEADER, axes=(replace(HEADER.axes[0], name="q"), HEADER.axes[1]))
    records = data[len(encode_header(HEADER)) :]
    journal.path.write_bytes(encode_header(other) + records)
    with pytest.raises(UnusableInput, match=r"recording.journal: it is damaged: moves\[0\]"):
        recover_journal(journal.path)
    assert journal.path.exists()


@pytest.mark.parametrize("lost", ["cycle/arrival/x", "cycle/extra/x"])
def test_a_ledger_without_an_axis_is_refused(tmp_path, lost):
    journal = written(tmp_path)
    journal.close()
    path = recover_journal(journal.path).path
    with h5py.File(path, "a") as file:
        del file[lost]
    with pytest.raises(UnusableInput, match=f"{lost}: missing"):
        read_ledger(path)
