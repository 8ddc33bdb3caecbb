"""The cycle ledger: counted, and read back from a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stagectl.store import CycleLedger, read_ledger, write_recording
from stagedata import AxisSignals, Move, Recording


def small_recording(length: int = 50, seed: int = 1) -> Recording:
    rng = np.random.default_rng(seed)

    def axis() -> AxisSignals:
        return AxisSignals(
            rng.normal(size=length),
            rng.normal(size=length),
            rng.normal(size=length),
            rng.normal(size=length),
            rng.integers(0, 65536, length).astype(np.uint16),
            rng.random(length) > 0.1,
        )

    moves = (
        Move("macro", 3, 20, {"y": 0.0, "x": 0.1}, {"y": 0.5, "x": 0.2}, 1),
        Move("other", 25, 50, {"y": 0.5, "x": 0.2}, {"y": 0.0, "x": 0.0}, None),
    )
    return Recording(
        "machine: µ\n",
        "",
        "2026-11-02T08:00:00+00:00",
        np.arange(length) * 1e-3,
        {"y": axis(), "x": axis()},
        moves,
        "made",
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "recording.h5"
    write_recording(small_recording(), path)
    return path


def test_the_ledger_is_read_back(tmp_path: Path):
    arrival = np.full(50, 2e-4)
    arrival[[7, 8]] = np.nan
    late = np.arange(50) == 9
    path = tmp_path / "r.h5"
    ledger = CycleLedger({"y": arrival, "x": np.full(50, 1e-4)}, late)
    write_recording(small_recording(), path, ledger)
    read = read_ledger(path)
    assert read is not None
    np.testing.assert_array_equal(read.arrival["y"], arrival)
    assert (read.missed, read.late_cycles) == (2, 1)
    assert list(read.missed_per_cycle[6:10]) == [0, 1, 1, 0]


def test_a_recording_without_ledger_has_none(path: Path):
    assert read_ledger(path) is None
