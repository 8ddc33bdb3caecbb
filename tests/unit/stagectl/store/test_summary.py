"""The part of summary.json that comes from the samples."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stagectl.store import CycleLedger, finite, read_recording, summarise_samples

PERIODS = (1e-4, 1e-3)


@pytest.fixture(scope="module")
def recording():
    return read_recording(Path(__file__).parents[3] / "data" / "null-1-other-moves.h5")


def test_blocks_agree_with_the_moves_listed(recording):
    summary = summarise_samples(recording, *PERIODS)
    assert list(summary["moves"][0]) == [
        "site", "axis", "kind", "distance", "peak_error", "settling", "settled",
    ]  # fmt: skip
    assert summary["cycle"] == {"period": 0.001, "missed": 0, "late": 0}
    for kind in ("macro", "micro"):
        entries = [move for move in summary["moves"] if move["kind"] == kind]
        block = summary[kind]
        assert block["count"] == len(entries)
        for window in ("5e-08", "2e-07"):
            times = [move["settling"][window] for move in entries]
            assert block["settling_median"][window] == pytest.approx(np.median(times))
            assert block["settling_mean"][window] == pytest.approx(np.mean(times))
        assert block["peak_error_median"] == np.median([move["peak_error"] for move in entries])


def test_an_axis_that_does_not_move_has_no_entry(recording):
    distances = [abs(m.distance(axis)) for m in recording.moves for axis in recording.axes]
    still = sum(distance < 1e-9 for distance in distances)
    assert still
    assert len(summarise_samples(recording, *PERIODS)["moves"]) == len(distances) - still


def test_missed_and_late_cycles_are_counted(recording):
    length = len(recording)
    x = recording.axes["x"]
    missed = replace(x, valid=np.arange(length) != 5)
    masked = replace(recording, axes={"x": missed, "y": recording.axes["y"]})
    assert summarise_samples(masked, *PERIODS)["cycle"]["missed"] == 1
    sync = np.where(np.arange(length) == length - 1, 3e-5, 1e-5)
    sync[:2] = 1e-3  # late, and counted as such
    ledger = CycleLedger(
        {"x": np.where(missed.valid, 1e-4, np.nan), "y": np.zeros(length)},
        np.arange(length) < 2,
        sync=sync,
    )
    summary = summarise_samples(masked, *PERIODS, ledger)
    assert (summary["cycle"]["missed"], summary["cycle"]["late"]) == (1, 2)
    assert summary["punctuality"] == {
        "tardy": 0, "doubled": 0, "late_in_a_row": 2,
        "arrival": {
            "x": {"median": 1e-4, "p99": 1e-4, "max": 1e-4},
            "y": {"median": 0.0, "p99": 0.0, "max": 0.0},
        },
        "sync_off": {"median": 0.0, "p99": 0.0, "max": 2e-5},
    }  # fmt: skip


def test_unknown_values_are_null(recording):
    empty = {"count": 0, "peak_error_median": None}
    empty |= {f"settling_{name}": {} for name in ("median", "mean", "p90")}
    assert summarise_samples(replace(recording, moves=()), *PERIODS)["micro"] == empty
    assert [finite(value) for value in (1.5, float("nan"), float("inf"), None)] == [
        1.5, None, None, None,
    ]  # fmt: skip
