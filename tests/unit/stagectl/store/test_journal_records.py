"""A damaged journal: the damage is cut out and said; everything else is what was written."""

from pathlib import Path

import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.store import Journal, read_ledger, read_recording, recover_journal
from stagectl.store.journal import encode_header, sample_dtype
from stagectl.store.journal_reader import parse_journal
from tests.unit.stagectl.store.journals import HEADER, content_of, sample, written

COUNT = 7
START = len(encode_header(HEADER))
SIZE = sample_dtype(2).itemsize


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    journal = written(tmp_path_factory.mktemp("journal"), COUNT)
    journal.finish("completed")
    return journal.path.read_bytes()


def parsed(data):
    content = parse_journal(data, Path("j"))
    return content


def is_as_written(content):
    """Whether every sample that counts is what was written, at its place and time."""
    recording = content.recording
    count = len(recording)
    assert np.allclose(recording.time, np.arange(count) * 1e-3, rtol=0, atol=1e-9)
    x = recording.axes["x"]
    return bool(
        np.allclose(x.position_actual[x.valid], (1 - np.arange(count)[x.valid]) * 1e-9, rtol=1e-9)
        and np.allclose(x.position_demand, -np.arange(count) * 1e-9, rtol=1e-9)
    )


def test_one_flipped_bit_costs_one_sample_or_one_note_and_is_said(data):
    lost_samples = lost_notes = 0
    notes = len(parsed(data).notes.events) + len(parsed(data).recording.moves)
    for at in range(START, len(data)):
        flipped = bytearray(data)
        flipped[at] ^= 1 << at % 8
        content = parsed(bytes(flipped))
        assert is_as_written(content), at
        lost = COUNT - int(content.recording.axes["x"].valid.sum())
        assert lost <= 1, at
        said = content.problem is not None  # by an event in addition
        kept = len(content.notes.events) - said + len(content.recording.moves)
        gone = notes - kept + (content.notes.outcome == "killed")
        assert lost + gone == 1, at
        assert said or content.notes.outcome == "killed", at  # the last note may look cut
        lost_samples, lost_notes = lost_samples + lost, lost_notes + gone
    assert lost_samples == COUNT * SIZE
    assert lost_notes > 0


def test_a_flipped_bit_in_the_header_is_no_other_stage(data):
    for at in range(START - 1):
        flipped = bytearray(data)
        flipped[at] ^= 1 << at % 8
        with pytest.raises(UnusableInput, match=r"damaged|not a journal|another version"):
            parse_journal(bytes(flipped), Path("j"))


def test_a_lost_stretch_is_filled_with_samples_that_do_not_count(tmp_path):
    journal = Journal(tmp_path, HEADER)
    for k in range(40):
        journal.sink(sample(k))
    journal.close()
    data = bytearray(journal.path.read_bytes())
    data[START : START + SIZE] = bytes(SIZE)  # the first one
    data[START + 12 * SIZE + 7 : START + 20 * SIZE - 3] = b"SJ" * ((8 * SIZE - 10) // 2)
    journal.path.write_bytes(data)
    recovered = recover_journal(journal.path)
    assert "9 samples with them: lost like missed ones" in recovered.describe()
    recording, ledger = read_recording(recovered.path), read_ledger(recovered.path)
    lost = [0, *range(12, 20)]
    x = recording.axes["x"]
    assert list(np.flatnonzero(~x.valid)) == lost
    assert list(np.flatnonzero(np.isnan(ledger.arrival["x"]))) == lost
    np.testing.assert_allclose(recording.time, np.arange(40) * 1e-3, atol=1e-9)
    np.testing.assert_allclose(x.position_actual[12:20], (1 - 11) * 1e-9)
    np.testing.assert_allclose(x.position_demand[1:], -np.arange(1, 40) * 1e-9)


def test_a_damaged_end_is_said_and_a_cut_one_is_not(data):
    assert parsed(data).problem is None
    assert parsed(data[:-5]).problem is None
    assert parsed(data + bytes(100)).problem == "100 bytes of the journal are damaged"


def test_an_index_out_of_reach_is_no_sample(tmp_path):
    """Else a few bytes could ask for any number of lost samples."""
    journal = Journal(tmp_path, HEADER)
    journal.sink(sample(0))
    journal.samples = 4_000_000_000
    journal.sink(sample(1))
    content = content_of(journal)
    assert len(content.recording) == 1
    assert content.problem is not None
