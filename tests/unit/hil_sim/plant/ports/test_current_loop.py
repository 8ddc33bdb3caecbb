"""Dead time and lag of the current loop in steps of the plant."""

import numpy as np

from hil_sim.plant.arrays import Arrays


def test_a_dead_time_is_whole_ticks_and_a_share_of_each_substep(nominal, with_effects, effects):
    def shares(seconds):
        arrays = Arrays(with_effects(nominal, effects["dead_time"].at(delay=seconds)), (0.0, 0.0))
        record = arrays.plant[0]
        begin = int(record["delay_share"])
        return int(record["delay_ticks"]), arrays.arena[begin : begin + 5]

    ticks, share = shares(2e-4)  # two whole ticks
    assert ticks == 2
    np.testing.assert_allclose(share, 0.0)
    ticks, share = shares(2.6e-4)  # and three of five substeps
    assert ticks == 2
    np.testing.assert_allclose(share, [1, 1, 1, 0, 0], atol=1e-9)
    _, share = shares(2.5e-4)  # in the middle of the third: what has decayed since counts less
    assert 0.4 < share[2] < 0.5
