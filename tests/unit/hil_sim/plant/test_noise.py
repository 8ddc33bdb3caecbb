"""Random numbers of the plant: repeatable, and independent between axes and sources."""

import numpy as np

from hil_sim.plant.noise import Noise


def test_the_same_seed_draws_the_same_whatever_the_chunks():
    whole = Noise(2, 5).draw(100)
    chunks = Noise(2, 5)
    np.testing.assert_array_equal(np.concatenate([chunks.draw(30), chunks.draw(70)], axis=2), whole)
    assert not np.array_equal(Noise(2, 6).draw(100), whole)


def test_axes_and_sources_do_not_share_numbers():
    drawn = Noise(2, 5).draw(2000).reshape(4, -1)
    correlation = np.corrcoef(drawn) - np.eye(4)
    assert np.abs(correlation).max() < 0.1
    assert np.abs(drawn.std(axis=1) - 1.0).max() < 0.05


def test_another_axis_leaves_the_first_ones_numbers_as_they_are():
    np.testing.assert_array_equal(Noise(1, 5).draw(10), Noise(2, 5).draw(10)[:1])


def test_no_seed_is_no_noise():
    assert not Noise(2, None).draw(10).any()
