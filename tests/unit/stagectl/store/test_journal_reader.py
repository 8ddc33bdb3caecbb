"""A journal read back, wherever it was cut, and while it is being written."""

import numpy as np
import pytest

from stagectl.errors import StagectlError, UnusableInput
from stagectl.store import Journal, read_journal_notes
from stagectl.store.journal import TEXT_TAG
from stagectl.store.journal_reader import parse_journal
from tests.unit.stagectl.store.journals import HEADER, content_of, sample, written


def test_a_journal_cut_at_any_byte_gives_every_whole_sample_before_the_cut(tmp_path):
    journal = written(tmp_path, 7)
    journal.close()
    data = journal.path.read_bytes()
    cut = tmp_path / "cut.journal"
    counts = []
    for length in range(len(data) + 1):
        cut.write_bytes(data[:length])
        content = parse_journal(cut.read_bytes(), cut)
        if content is None:
            counts.append(0)
            continue
        assert content.notes.outcome == "killed"
        assert all(m.end <= len(content.recording) for m in content.recording.moves)
        counts.append(len(content.recording))
        np.testing.assert_array_equal(
            content.recording.axes["y"].position_demand, np.arange(counts[-1]) * 2 * 1e-8
        )
    assert counts == sorted(counts)
    assert set(counts) == set(range(8))
    assert counts[-1] == 7


def test_zeros_in_place_of_a_note_end_the_journal(tmp_path):
    journal = written(tmp_path, 20)
    journal.path.write_bytes(journal.path.read_bytes() + bytes((TEXT_TAG,)) + bytes(40))
    assert len(content_of(journal).recording) == 20


def test_a_run_of_many_samples_spans_blocks(tmp_path):
    journal = Journal(tmp_path, HEADER)
    for k in range(20_000):
        journal.sink(sample(k))
    journal.event("end")
    journal.sink(sample(20_000))
    content = content_of(journal)
    assert len(content.recording) == 20_001
    assert content.notes.events[0]["sample"] == 20_000


def test_the_notes_of_a_run_in_progress_are_read_only_when_asked_for(tmp_path):
    journal = written(tmp_path, 7)
    with pytest.raises(StagectlError, match="in progress"):
        read_journal_notes(journal.path)
    notes = read_journal_notes(journal.path, locked=False)
    assert (notes.outcome, notes.fault, notes.recipe) == ("killed", None, HEADER.recipe)
    assert [event["number"] for event in notes.events] == [0, 5]
    journal.finish("fault", "axis x: following error")
    ended = read_journal_notes(journal.path)
    assert (ended.outcome, ended.fault) == ("fault", "axis x: following error")
    assert journal.path.exists()


def test_a_journal_cut_within_its_header_has_no_notes(tmp_path):
    path = tmp_path / "recording.journal"
    path.write_bytes(b"stagectl-journal")
    assert read_journal_notes(path) is None
    path.write_bytes(b"stagectl-journal 1 {}\n")
    with pytest.raises(UnusableInput, match="a journal of another version"):
        read_journal_notes(path)
