"""The data of the report's charts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stagectl.report.traces import BEFORE, chart_data
from stagedata import Recording
from tests.unit.stagectl.report.conftest import summary_of

TC, TS = 1e-4, 1e-3


def test_missed_samples_are_gaps(recording: Recording):
    k = recording.moves[2].start
    x = replace(recording.axes["x"], valid=np.arange(len(recording)) != k)
    masked = replace(recording, axes={"x": x, "y": recording.axes["y"]})
    data = chart_data(masked, summary_of(masked), TC)
    assert data["moves"][2]["error"]["x"][BEFORE] is None
    assert data["moves"][2]["force"]["x"][BEFORE] is None
    assert data["moves"][2]["error"]["y"][BEFORE] is not None


def test_a_move_outside_a_window_at_its_end_is_marked_for_that_window(
    recording: Recording, summary: dict[str, Any]
):
    drawn = chart_data(recording, summary, TC)["settling"]
    assert [("5e-08" in e["outside"]) for e in drawn] == [
        not m["settled"] for m in summary["moves"]
    ]
    wider = [e for e in drawn if "2e-07" in e["outside"]]
    assert 0 < len(wider) < sum("5e-08" in e["outside"] for e in drawn)
    for entry in wider:  # outside the wider window at the end: the whole time for both
        assert entry["times"]["2e-07"] == entry["times"]["5e-08"]


def test_a_long_run_embeds_its_slowest_micro_moves_and_says_how_many_it_leaves_out(
    recording: Recording, summary: dict[str, Any]
):
    data = chart_data(recording, summary, TC, max_samples=2000)
    assert 0 < len(data["moves"]) < 15
    assert data["left_out"] == len(recording.moves) - len(data["moves"])
    assert {move["kind"] for move in data["moves"]} == {"micro"}
    assert len(data["settling"]) == len(summary["moves"])  # the overview stays whole
    assert data["moves"][data["first"]]["kind"] == "micro"


def test_a_summary_of_another_recording_is_refused(recording: Recording, summary: dict[str, Any]):
    with pytest.raises(ValueError, match="not those of the recording"):
        chart_data(replace(recording, moves=recording.moves[:5]), summary, TC)
