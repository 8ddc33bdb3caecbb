"""The journal: what goes in comes back, wherever it was cut."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from stagectl.errors import StagectlError
from stagectl.store import (
    AxisScaling,
    Journal,
    JournalHeader,
    sample_codec,
    sample_dtype,
)
from stagectl.store.recovery import read_journal

HEADER = JournalHeader(
    "machine: µ\n",
    "recipe: r\n",
    "2026-11-02T08:00:00+00:00",
    (AxisScaling("x", 1e-9, 0.04), AxisScaling("y", 1e-8, 0.06)),
)
TEN_S = 10_000_000_000


EXTRA = {6: 1, 10: 2}
"""TPDOs of y in addition, reported with the sample after: a double of 5; of 9, late and twice."""


def sample(k: int) -> tuple[int, ...]:
    """Sample k; the TPDO of y misses every tenth SYNC."""
    missed = k % 10 == 9
    return (
        TEN_S + k * 1_000_000, k == 4, 10 * k, -1 if k == 5 else 20,
        -k, 25, -k + 1, -26, 4663, True, 200_000, 0,
        2 * k, 0, 2 * k, 1, 0x1237, not missed, -1 if missed else 300_000, EXTRA.get(k, 0),
    )  # fmt: skip


def test_codec_and_dtype_are_the_same_record():
    for axes in (1, 2, 3):
        assert sample_codec(axes).size == sample_dtype(axes).itemsize


def test_an_event_may_hold_numpy_values_and_dataclasses(tmp_path: Path):
    journal = Journal(tmp_path, HEADER)
    scaling = HEADER.axes[0]
    journal.event("e", count=np.int64(3), values=np.array([1.5, 2.5]), scaling=scaling, at=tmp_path)
    journal.sink(sample(0))
    journal.close()
    content = read_journal(journal.path)
    assert content is not None
    assert content.events == (
        {
            "event": "e", "sample": 0, "count": 3, "values": [1.5, 2.5],
            "scaling": {"name": "x", "increment": 1e-9, "force_unit": 0.04}, "at": str(tmp_path),
        },
    )  # fmt: skip


def test_a_run_of_many_samples_spans_blocks(tmp_path: Path):
    journal = Journal(tmp_path, HEADER)
    for k in range(20_000):
        journal.sink(sample(k))
    journal.event("end")
    journal.sink(sample(20_000))
    journal.close()
    content = read_journal(journal.path)
    assert content is not None
    assert len(content.recording) == 20_001
    assert content.events[0]["sample"] == 20_000


def test_a_second_run_does_not_overwrite_a_journal(tmp_path: Path):
    with Journal(tmp_path, HEADER), pytest.raises(StagectlError, match="another run"):
        Journal(tmp_path, HEADER)
    with pytest.raises(StagectlError, match="cannot create"):
        Journal(tmp_path / "absent", HEADER)


def test_a_full_disk_is_an_error_not_a_gap(tmp_path: Path):
    journal = Journal(tmp_path, HEADER)
    os.close(journal._fd)  # noqa: SLF001 (the only disk at hand that refuses everything)
    journal._fd = os.open("/dev/full", os.O_WRONLY)  # noqa: SLF001
    with pytest.raises(StagectlError, match="No space left"):
        journal.sink(sample(0))
    assert journal.samples == 0
    journal.close()
