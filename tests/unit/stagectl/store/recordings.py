"""A recording with every kind of sample, small enough to compare whole."""

import numpy as np

from stagedata import AxisSignals, Move, Recording


def small_recording(length=50, seed=1):
    rng = np.random.default_rng(seed)

    def axis():
        words = rng.integers(0, 65536, length).astype(np.uint16)
        return AxisSignals(*rng.normal(size=(4, length)), words, rng.random(length) > 0.1)

    moves = (
        Move("macro", 3, 20, {"y": 0.0, "x": 0.1}, {"y": 0.5, "x": 0.2}, 1),
        Move("other", 25, 50, {"y": 0.5, "x": 0.2}, {"y": 0.0, "x": 0.0}, None),
    )
    time, axes = np.arange(length) * 1e-3, {"y": axis(), "x": axis()}
    return Recording("machine: µ\n", "", "2026-11-02T08:00:00+00:00", time, axes, moves, "made")
