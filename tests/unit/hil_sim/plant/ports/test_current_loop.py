"""Dead time and lag of the current loop in steps of the plant, fine and coarse."""

import numpy as np
import pytest

from hil_sim.plant.arrays import Arrays
from hil_sim.plant.ports.current_loop import motor_weights


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


DECAY = 0.19  # 1500 Hz, 20 us


def fine_steps(decay, share, before, now, start):
    """Force at the end, mean in the velocity, mean in the displacement, one step at a time."""
    count = len(share)
    gain, force, velocity, displacement = 1.0 - np.exp(-decay), start, 0.0, 0.0
    for old in share:
        force += gain * (old * before + (1.0 - old) * now - force)
        velocity += force / count
        displacement += velocity / count  # semi-implicit: the new velocity moves it
    return force, velocity, displacement


@pytest.mark.parametrize(
    "share", [np.zeros(5), np.array([1.0, 1.0, 0.3, 0.0, 0.0]), np.ones(5), np.array([0.4])]
)
@pytest.mark.parametrize(("before", "now", "start"), [(0, 1, 0), (3, -2, 5), (1, 1, 1)])
def test_they_make_the_sums_of_the_fine_steps(share, before, now, start):
    weights = motor_weights(DECAY, share)
    count = len(share)
    whole = np.array([1.0, 1.0, (count + 1) / (2 * count)])
    made = weights[:, 0] * before + weights[:, 1] * start + (whole - weights.sum(axis=1)) * now
    np.testing.assert_allclose(made, fine_steps(DECAY, share, before, now, start), rtol=1e-12)
