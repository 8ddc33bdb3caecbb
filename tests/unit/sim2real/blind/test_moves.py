"""Random move sequences of the blind check."""

from __future__ import annotations

import numpy as np

from sim2real.blind import moves
from sim2real.blind.moves import draw_demands


def test_demands_stay_within_what_the_page_says(stage):
    for seed in range(8):
        demands = draw_demands(np.random.default_rng(seed), stage, 4.0)
        velocity = np.abs(np.diff(demands.position, axis=0)) / stage.sync_period
        acceleration = np.abs(np.diff(demands.position, 2, axis=0)) / stage.sync_period**2
        assert velocity.max() <= moves.MACRO_SPEED + 2e-6
        assert acceleration.max() <= moves.MACRO_ACCELERATION + 4e-3  # rounded to 1 nm
        assert np.abs(demands.position).max() <= moves.REACH[1] + moves.MICRO_REACH * 40
        rests = [b.start - a.end for a, b in zip(demands.moves, demands.moves[1:], strict=False)]
        assert min(rests) >= round(moves.REST[0] / stage.sync_period)
        assert max(rests) <= round(moves.REST[1] / stage.sync_period)
        for move in demands.moves:
            for a, axis in enumerate(stage.axes):
                assert demands.position[move.end - 1, a] == move.target[axis.name]
            if move.kind == "micro":
                assert max(abs(move.distance(n)) for n in ("x", "y")) <= moves.MICRO_REACH + 1e-9
        units = demands.offset / np.array([a.control.rated_force / 1000 for a in stage.axes])
        assert np.allclose(units, np.round(units), atol=1e-9)
