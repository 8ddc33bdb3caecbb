"""The journal: what may go in, and what keeps it from being written."""

import os

import numpy as np
import pytest

from stagectl.errors import StagectlError
from stagectl.store import Journal, sample_codec, sample_dtype
from stagectl.store.journal import CHECKSUM
from tests.unit.stagectl.store.journals import HEADER, content_of, sample


def test_codec_and_dtype_are_the_same_record():
    for axes in (1, 2, 3):
        dtype = sample_dtype(axes)
        assert sample_codec(axes).size + CHECKSUM.size == dtype.itemsize
        assert dtype.fields["crc"][1] == dtype.itemsize - CHECKSUM.size


def test_an_event_may_hold_numpy_values_and_dataclasses(tmp_path):
    journal = Journal(tmp_path, HEADER)
    scaling = HEADER.axes[0]
    journal.event("e", count=np.int64(3), values=np.array([1.5, 2.5]), scaling=scaling, at=tmp_path)
    journal.sink(sample(0))
    assert content_of(journal).notes.events == (
        {
            "event": "e", "sample": 0, "count": 3, "values": [1.5, 2.5],
            "scaling": {"name": "x", "increment": 1e-9, "force_unit": 0.04}, "at": str(tmp_path),
        },
    )  # fmt: skip


def test_a_second_run_does_not_overwrite_a_journal(tmp_path):
    with Journal(tmp_path, HEADER), pytest.raises(StagectlError, match="another run"):
        Journal(tmp_path, HEADER)
    with pytest.raises(StagectlError, match="cannot create"):
        Journal(tmp_path / "absent", HEADER)


def test_a_full_disk_is_an_error_not_a_gap(tmp_path):
    journal = Journal(tmp_path, HEADER)
    os.close(journal._fd)  # noqa: SLF001 (the only disk at hand that refuses everything)
    journal._fd = os.open("/dev/full", os.O_WRONLY)  # noqa: SLF001
    with pytest.raises(StagectlError, match="No space left"):
        journal.sink(sample(0))
    assert journal.samples == 0
    journal.close()
