"""Samples numbered by SYNC period, from time stamps that jitter, jump and drift."""

import numpy as np
import pytest

from sim2real.gap import match_periods, number_periods
from sim2real.gap.sync_grid import skipped_periods

PERIOD = 1e-3


def test_jitter_and_a_few_late_stamps_skip_nothing():
    time = PERIOD * np.arange(100) + np.random.default_rng(1).normal(0.0, 1e-4, 100)
    time[40:43] += 1.4 * PERIOD
    np.testing.assert_array_equal(number_periods(time, PERIOD), np.arange(100))


def test_a_lasting_jump_skips_whole_periods():
    time = PERIOD * np.concatenate((np.arange(50), np.arange(53, 103)))
    place = number_periods(time, PERIOD)
    assert (np.diff(place) > 0).all()
    assert place[49] == 49
    assert place[50] == 53


def test_a_drifting_clock_is_counted_in_its_own_periods():
    time = 1.02 * PERIOD * np.arange(1000)
    np.testing.assert_array_equal(match_periods(time, PERIOD), np.arange(1000))


def test_what_was_skipped_between_two_blocks_is_counted():
    after = PERIOD * np.arange(104, 204)
    assert skipped_periods(PERIOD * 103.1, after, PERIOD) == 0
    assert skipped_periods(PERIOD * 99, after, PERIOD) == 4
    with pytest.raises(ValueError, match="spread over"):
        skipped_periods(-2.0, after, PERIOD)


def test_samples_of_another_period_or_of_several_runs_do_not_match():
    with pytest.raises(ValueError, match=r"0.002 s apart.*0.001 s"):
        match_periods(2e-3 * np.arange(100), PERIOD)
    apart = np.concatenate((np.arange(50.0), 1e6 + np.arange(50.0)))
    with pytest.raises(ValueError, match="spread over"):
        match_periods(PERIOD * apart, PERIOD)
