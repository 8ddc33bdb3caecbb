"""Shares of the gap, closed and given back, from the energies of moves."""

import numpy as np
import pytest

from sim2real.held_out import combined_energy, share_closed, share_given_back

SAMPLES = np.full((40, 2), 100.0)
FLOOR = SAMPLES.copy()
"""Energies of a model that leaves nothing but the floor: 1 for each sample."""


def test_combined_energy_is_one_per_signal_at_the_floor():
    assert combined_energy(FLOOR, SAMPLES) == pytest.approx(2.0)


def test_share_closed_counts_above_the_floor():
    share, interval = share_closed(9.0 * FLOOR, 3.0 * FLOOR, SAMPLES)
    assert share == pytest.approx(0.75)
    assert interval == pytest.approx((0.75, 0.75))


def test_the_interval_covers_moves_that_differ():
    after = FLOOR * np.where(np.arange(40) % 2, 1.0, 5.0)[:, None]
    share, interval = share_closed(9.0 * FLOOR, after, SAMPLES)
    assert share == pytest.approx(0.75)
    assert interval is not None
    assert 0.6 < interval[0] < 0.75 < interval[1] < 0.9


def test_a_small_gap_has_no_share():
    assert share_closed(1.4 * FLOOR, FLOOR, SAMPLES) == (None, None)


def test_an_effect_gives_back_what_its_removal_reopens():
    share, interval = share_given_back(9.0 * FLOOR, 5.0 * FLOOR, FLOOR, SAMPLES)
    assert share == pytest.approx(0.5)
    assert interval == pytest.approx((0.5, 0.5))


def test_no_share_exceeds_all():
    share, _ = share_closed(3.0 * FLOOR, 0.5 * FLOOR, SAMPLES)
    assert share == 1.0
    below_the_floor, _ = share_given_back(2.0 * FLOOR, 2.0 * FLOOR, 0.5 * FLOOR, SAMPLES)
    assert below_the_floor == pytest.approx(1.0)
    held, _ = share_given_back(3.0 * FLOOR, 21.0 * FLOOR, FLOOR, SAMPLES)
    assert held == pytest.approx(1.0)
