"""Candidate sequences stay within what the recordings did."""

import numpy as np

from sim2real.experiment.sequences import Reach, candidate_sequences, repeat_moves, setpoints

REACH = {"x": Reach(-0.05, 0.06, 0.4, 3.0), "y": Reach(-0.02, 0.03, 0.4, 3.0)}
MACRO = {"velocity": 0.4, "acceleration": 3.0, "jerk": 100.0}


def test_every_sequence_keeps_to_range_speed_and_acceleration(stage):
    found = candidate_sequences(stage, "x", REACH)
    assert len({name for name, _ in found}) == 7
    for _, moves in found:
        demand = setpoints(moves, stage, MACRO)
        for a, name in enumerate(("x", "y")):
            low, high = REACH[name].low, REACH[name].high
            assert low - 1e-4 <= demand[:, a].min()
            assert demand[:, a].max() <= high + 1e-4
        speed = np.abs(np.diff(demand, axis=0)) / stage.sync_period
        acceleration = np.abs(np.diff(demand, 2, axis=0)) / stage.sync_period**2
        assert speed.max() <= 0.4 + 1e-6
        assert acceleration.max() <= 3.0 + 1e-6
        assert np.ptp(demand, axis=0).max() > 0.0


def test_short_sequences_are_repeated_until_they_take_long_enough(stage):
    reach = {name: Reach(-1e-4, 1e-4, 0.02, 1.0) for name in REACH}
    macro = {"velocity": 0.02, "acceleration": 1.0, "jerk": 100.0}
    found = candidate_sequences(stage, "x", reach)

    def seconds(moves):
        return len(setpoints(moves, stage, macro)) * stage.sync_period

    assert min(seconds(moves) for _, moves in found) < 1.0
    for _, moves in found:
        repeated = repeat_moves(moves, stage, macro, 1.0)
        assert seconds(repeated) >= 1.0
        assert repeated[: len(moves)] == moves
        assert len(repeated) == len(moves) or seconds(moves) < 1.0
