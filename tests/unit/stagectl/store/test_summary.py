"""summary.json: every key of docs/formats/run.md, and valid JSON whatever the figures."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stagectl.errors import StagectlError
from stagectl.store import (
    CycleLedger,
    FrictionEntry,
    ParameterEstimate,
    RunFacts,
    build_summary,
    read_recording,
    write_summary,
)
from stagedata import Recording

FACTS = RunFacts("r", "wafer-xy", "estimated", 1, True, None, 9.7, 0.6, "completed")
PERIODS = {"control_period": 1e-4, "sync_period": 1e-3}
FRICTION = [
    FrictionEntry(
        1,
        "x",
        True,
        None,
        3e-5,
        {"coulomb": ParameterEstimate(6.0, 0.01, "N")},
        {"coulomb": 1.5},
        ["viscous"],
    ),
    FrictionEntry(2, "y", False, "not excited", 3e-5, {}),
]


@pytest.fixture(scope="module")
def recording() -> Recording:
    return read_recording(Path(__file__).parents[3] / "data" / "null-1-other-moves.h5")


def test_a_summary_has_the_keys_of_the_format(recording: Recording):
    summary = build_summary(recording, FACTS, FRICTION, **PERIODS)
    assert list(summary) == [
        "format", "version", "recipe", "machine", "compensation", "seed", "simulated", "lot",
        "duration", "wall_time", "outcome", "fault", "moves", "friction", "micro", "macro", "cycle",
    ]  # fmt: skip
    assert list(summary["moves"][0]) == [
        "site", "axis", "kind", "distance", "peak_error", "settling", "settled",
    ]  # fmt: skip
    assert list(summary["moves"][0]["settling"]) == ["5e-08", "2e-07"]
    assert summary["friction"][0]["parameters"] == {
        "coulomb": {"value": 6.0, "sigma": 0.01, "unit": "N"}
    }
    assert summary["friction"][0]["gain"] == {"coulomb": 1.5}
    assert summary["friction"][0]["held"] == ["viscous"]
    assert summary["friction"][1]["reason"] == "not excited"
    assert summary["cycle"] == {"period": 0.001, "missed": 0, "late": 0}
    step = {"axis": "x", "place": (0.0, 0.0), "time": 3.0, "change": 0.2, "everywhere": False}
    facts = replace(FACTS, wafer="W3", map=2, steps=(step,))
    built = build_summary(recording, facts, FRICTION, **PERIODS)
    assert {name: built[name] for name in built.keys() - summary.keys()} == {
        "wafer": "W3", "map": 2, "steps": [step]
    }  # fmt: skip


def test_blocks_agree_with_the_moves_listed(recording: Recording):
    summary = build_summary(recording, FACTS, (), **PERIODS)
    for kind in ("macro", "micro"):
        entries = [move for move in summary["moves"] if move["kind"] == kind]
        block = summary[kind]
        assert block["count"] == len(entries)
        for window in ("5e-08", "2e-07"):
            times = [move["settling"][window] for move in entries]
            assert block["settling_median"][window] == pytest.approx(np.median(times))
            assert block["settling_mean"][window] == pytest.approx(np.mean(times))
        assert block["peak_error_median"] == np.median([move["peak_error"] for move in entries])


def test_an_axis_that_does_not_move_has_no_entry(recording: Recording):
    still = [
        (number, axis)
        for number, move in enumerate(recording.moves)
        for axis in recording.axes
        if abs(move.distance(axis)) < 1e-9
    ]
    summary = build_summary(recording, FACTS, (), **PERIODS)
    assert still
    assert len(summary["moves"]) == 2 * len(recording.moves) - len(still)


def test_missed_and_late_cycles_are_counted(recording: Recording):
    length = len(recording)
    x = recording.axes["x"]
    missed = replace(x, valid=np.arange(length) != 5)
    masked = replace(recording, axes={"x": missed, "y": recording.axes["y"]})
    assert build_summary(masked, FACTS, (), **PERIODS)["cycle"]["missed"] == 1
    ledger = CycleLedger(
        {"x": np.where(missed.valid, 1e-4, np.nan), "y": np.zeros(length)}, np.arange(length) < 2
    )
    summary = build_summary(masked, FACTS, (), **PERIODS, ledger=ledger)
    assert (summary["cycle"]["missed"], summary["cycle"]["late"]) == (1, 2)
    assert summary["punctuality"] == {
        "tardy": 0, "doubled": 0, "late_in_a_row": 2,
        "arrival": {
            "x": {"median": 1e-4, "p99": 1e-4, "max": 1e-4},
            "y": {"median": 0.0, "p99": 0.0, "max": 0.0},
        },
    }  # fmt: skip


def test_unknown_values_are_null(recording: Recording, tmp_path: Path):
    nan = float("nan")
    entry = FrictionEntry(1, "x", False, "r", nan, {"coulomb": ParameterEstimate(nan, nan, "N")})
    summary = build_summary(replace(recording, moves=()), FACTS, [entry], **PERIODS)
    write_summary(summary, tmp_path / "summary.json")
    read = json.loads((tmp_path / "summary.json").read_text())
    assert read == summary
    assert read["friction"][0]["parameters"]["coulomb"]["value"] is None
    assert read["micro"] == {
        "count": 0, "peak_error_median": None,
        "settling_median": {}, "settling_mean": {}, "settling_p90": {},
    }  # fmt: skip
    assert [p.name for p in tmp_path.iterdir()] == ["summary.json"]


def test_a_summary_that_cannot_be_written_is_one_line(tmp_path: Path):
    with pytest.raises(StagectlError, match="cannot write the summary"):
        write_summary({}, tmp_path / "absent" / "summary.json")
