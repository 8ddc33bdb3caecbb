"""The data of the charts of single moves: what is embedded is what was recorded and simulated."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sim2real.phases import split_moves
from stagectl.report.gap.moves import move_data
from stagedata import aligned_demand

RATIO = 0.1


def unpacked(series, kind):
    return np.cumsum(series[kind]) * series["step"]


def test_every_move_is_there_and_unpacks_to_its_signals(measured, settings):
    data = move_data([measured], [measured.floor.nominal], settings, "y", max_values=10**9)
    blocks = split_moves(measured.replay.recording, measured.replay.period)
    assert len(data["moves"]) == len(blocks)
    assert (data["every"], data["axis"], data["kinds"]) == (1, "y", ["before", "after"])
    json.dumps(data, allow_nan=False)
    signals = measured.replay.recording.axes["x"]
    for move, block in zip(data["moves"], blocks, strict=True):
        first = round(block.moving + move["start"] / move["step"])
        shown = slice(first, block.stop)
        force = move["axes"]["x"]["force"]
        assert unpacked(force, "measured") == pytest.approx(
            signals.force_actual[shown], abs=force["step"]
        )
        error = move["axes"]["x"]["error"]
        expected = 1e6 * (aligned_demand(signals, RATIO) - signals.position_actual)[shown]
        assert unpacked(error, "measured") == pytest.approx(expected, abs=error["step"])
        assert error["step"] < 1e-3 * max(np.abs(expected).max(), 1e-9)


def test_the_move_with_the_largest_force_residual_comes_first(measured, settings):
    blocks = split_moves(measured.replay.recording, measured.replay.period)
    energies = [
        np.sum(measured.residual["x"]["force"][block.moving : block.end] ** 2) for block in blocks
    ]
    assert move_data([measured], None, settings, "x")["first"] == int(np.argmax(energies))


def test_long_recordings_are_shown_with_fewer_samples(measured, settings):
    whole = len(json.dumps(move_data([measured], None, settings, "x", max_values=10**9)))
    data = move_data([measured], None, settings, "x", max_values=10_000)
    assert data["every"] > 1
    assert len(json.dumps(data)) < whole / data["every"] * 2
    assert len(data["moves"]) == len(split_moves(measured.replay.recording, 1e-3))


def test_where_only_forces_are_compared_there_is_no_following_error(measured, settings):
    forces = {**measured.gap, "x": {"force": measured.gap["x"]["force"]}}
    for move in move_data([replace(measured, gap=forces)], None, settings, "x")["moves"]:
        assert set(move["axes"]["x"]) == {"force"}
        assert set(move["axes"]["y"]) == {"force", "error"}
