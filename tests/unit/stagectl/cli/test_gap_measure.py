"""`stagectl gap measure`: its memory."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np

from stagectl.cli.gap_measure import measured_gap
from stagectl.config import load_machine, stage_settings
from stagectl.store import RecordingBlocks, read_recording, write_recording
from stagedata import AxisSignals

SOURCE = Path(__file__).parents[3] / "data" / "null-2.h5"
BLOCK = 3000


def repeated(times, path):
    """The source there and back, again and again, without its moves."""
    source = read_recording(SOURCE)

    def again(values):
        return np.tile(np.concatenate((values[:BLOCK], values[BLOCK - 1 :: -1])), times)

    axes = {
        name: AxisSignals(
            again(s.position_demand), again(s.force_offset), again(s.position_actual),
            again(s.force_actual), None, again(s.valid),
        )
        for name, s in source.axes.items()
    }  # fmt: skip
    time = np.arange(2 * BLOCK * times) * 1e-3
    write_recording(replace(source, time=time, axes=axes, moves=()), path)


def test_memory_does_not_grow_with_the_recording(tmp_path):
    settings = stage_settings(load_machine())
    peaks = []
    for times in (1, 1, 4):  # the first compiles and imports
        repeated(times, tmp_path / "r.h5")
        blocks = RecordingBlocks(tmp_path / "r.h5", BLOCK)
        tracemalloc.start()
        try:
            assert len(blocks) == 2 * times
            assert set(measured_gap(blocks, settings, lambda *_: None).gap()) == {"x", "y"}
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[2] < 1.1 * peaks[1]
