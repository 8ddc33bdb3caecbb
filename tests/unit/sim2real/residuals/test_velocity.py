"""The mean residual over velocity: signs, directions and what does not count."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.residuals.velocity import average_over_velocity


def test_signed_means_tell_offset_coulomb_and_viscous_friction(with_residual):
    found = average_over_velocity(with_residual(lambda x, v: 1.0 + 2.0 * np.sign(v) + 30.0 * v))
    assert [m.direction for m in found] == [-1, 1]
    for means in found:
        assert np.sign(means.velocity).tolist() == [means.direction] * len(means.velocity)
        expected = 1.0 + 2.0 * means.direction + 30.0 * means.velocity
        assert means.mean["before"] == pytest.approx(expected, abs=0.01)


def test_what_does_not_depend_on_speed_is_spread(with_residual):
    for means in average_over_velocity(with_residual(lambda x, v: np.sin(2 * np.pi * x / 2e-3))):
        slow = np.abs(means.velocity) < 0.05
        assert np.abs(means.mean["before"][slow]).max() < 0.4
        assert means.spread["before"][slow].max() > 0.6


def test_rest_and_missed_samples_do_not_count(with_residual):
    sound = with_residual(lambda x, v: 1.0 + 0.0 * v)
    missed = np.arange(len(sound.position)) % 3 == 0
    force = np.where(missed, 1e6, sound.measured["force"])
    course = replace(sound, valid=~missed, measured={**sound.measured, "force": force})
    for means in average_over_velocity(course):
        assert means.mean["before"] == pytest.approx(1.0)
        assert means.spread["before"] == pytest.approx(0.0, abs=1e-6)


def test_speeds_that_do_not_occur_leave_a_gap_in_the_numbers_of_the_bins(course):
    fast = np.abs(course.velocity)
    course = replace(course, moving=(fast < 0.01) | (fast > 0.05))
    for means in average_over_velocity(course):
        assert (np.diff(means.bins) > 1).sum() == 1


def test_without_motion_there_is_nothing(course):
    still = np.zeros(len(course.position), dtype=bool)
    assert average_over_velocity(replace(course, moving=still)) == ()
