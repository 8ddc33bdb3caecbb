"""Surprises that go one way are drift; to and fro they are wander."""

import numpy as np
import pytest

from estimation.restlessness import Restlessness

WANDER = 0.01


def test_wander_hardly_ever_counts():
    generator = np.random.default_rng(3)
    restless = Restlessness()
    added = []
    for surprise in generator.normal(0.0, WANDER, 2000):
        restless.saw(surprise, WANDER**2)
        added.append(restless.variance)
    assert np.mean(np.array(added) > 0.0) < 0.03
    assert np.mean(added) < 0.02 * WANDER**2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stage_that_warms_up_is_noticed_within_a_few_moves(sign):
    generator = np.random.default_rng(4)
    restless = Restlessness()
    moves = 0
    while restless.variance == 0.0 and moves < 12:
        restless.saw(sign * 0.02 + generator.normal(0.0, WANDER), WANDER**2)
        moves += 1
    assert moves < 8
    for _ in range(10):
        restless.saw(sign * 0.02, WANDER**2)
    assert restless.variance == pytest.approx(0.02**2, rel=0.2)
    restless.calm()
    assert restless.variance == 0.0


def test_a_jump_is_not_taken_for_drift_of_its_size():
    restless = Restlessness()
    restless.saw(0.9, WANDER**2)
    assert restless.variance < 0.04**2
