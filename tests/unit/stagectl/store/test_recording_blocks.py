"""Recordings read in blocks: the same samples and moves, the same errors."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.store import RecordingBlocks, read_recording

DATA = Path(__file__).parents[3] / "data"
SOURCE = DATA / "null-2.h5"


def test_blocks_are_the_whole_in_parts():
    whole, blocks = read_recording(SOURCE), RecordingBlocks(SOURCE, 1000)
    parts = list(blocks)
    assert len(parts) == len(blocks) == 10
    assert blocks.samples == sum(map(len, parts)) == len(whole)
    assert max(map(len, parts)) <= 1500
    assert all(part.moves[0].start == 0 for part in parts[1:]), "a block begins with a move"
    for name, signals in whole.axes.items():
        for field in ("position_demand", "force_offset", "position_actual", "force_actual"):
            joined = np.concatenate([getattr(part.axes[name], field) for part in parts])
            np.testing.assert_array_equal(joined, getattr(signals, field))
    np.testing.assert_array_equal(np.concatenate([p.time for p in parts]), whole.time)
    first = np.cumsum([0, *map(len, parts)])
    moves = [
        (move.start + start, move.end + start, move.target)
        for start, part in zip(first, parts, strict=False)
        for move in part.moves
    ]
    assert moves == [(move.start, move.end, move.target) for move in whole.moves]


def test_moves_longer_than_a_block_are_listed_once():
    parts = list(RecordingBlocks(SOURCE, 150))
    assert sum(len(part.moves) for part in parts) == len(read_recording(SOURCE).moves)
    assert max(map(len, parts)) <= 225


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("time", 0.0, "/time: sample 4000: not later"),
        ("axes/y/force_actual", np.nan, "/axes/y/force_actual: sample 4000: is nan"),
    ],
)
@pytest.mark.parametrize("size", [1000, 4000, 10**6])
def test_a_bad_sample_is_named_by_its_place_in_the_recording(tmp_path, name, value, reason, size):
    path = tmp_path / "r.h5"
    path.write_bytes(SOURCE.read_bytes())
    with h5py.File(path, "a") as file:
        file[name][4000] = value
    with pytest.raises(UnusableInput) as caught:
        list(RecordingBlocks(path, size))
    assert str(caught.value).startswith(f"{path}: {reason}")


def test_time_that_does_not_go_on_from_block_to_block_is_named(tmp_path):
    path = tmp_path / "r.h5"
    path.write_bytes(SOURCE.read_bytes())
    joint = len(next(iter(RecordingBlocks(path, 5000))))
    with h5py.File(path, "a") as file:
        file["time"][joint:] = file["time"][joint:] - 0.002
    with pytest.raises(UnusableInput, match=f"/time: sample {joint}: not later"):
        list(RecordingBlocks(path, 5000))
