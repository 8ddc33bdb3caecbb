"""Differences and turns of sampled positions."""

import numpy as np
import pytest

from estimation.kinematics import differences, find_turns, slope

TS, NOISE = 1e-3, 1e-9


def turns(position):
    """Heading, share, place and sharpness at the inner samples."""
    count = len(position) - 2
    heading = np.zeros(count, np.int8)
    share, at, sharpness = np.empty(count), np.full(count, np.nan), np.full(count, np.nan)
    find_turns(position, NOISE, heading, share, at, sharpness)
    return heading, share, at, sharpness


def test_differences_are_exact_for_constant_acceleration():
    t = np.arange(50) * TS
    velocity, acceleration, usable = np.empty(48), np.empty(48), np.empty(48, dtype=bool)
    valid = np.ones(50, dtype=bool)
    valid[20] = False
    differences(0.1 + 0.2 * t + 1.5 * t**2, valid, TS, velocity, acceleration, usable)
    np.testing.assert_allclose(velocity, 0.2 + 3.0 * t[1:-1], rtol=1e-9)
    np.testing.assert_allclose(acceleration, 3.0, rtol=1e-6)
    assert np.flatnonzero(~usable).tolist() == [18, 19, 20]  # a hole spoils its neighbours


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_turn_is_found_at_the_vertex_of_the_motion(sign):
    k = np.arange(-60, 61)
    when, bend = 0.3, 2e-7  # at 0.3 samples behind the middle one; 0.2 um per squared sample
    x = np.concatenate([np.full(20, -(60.3**2)), -((k - when) ** 2), np.full(20, -(59.7**2))])
    heading, share, at, sharpness = turns(sign * bend * x)
    inner = np.flatnonzero(share >= 0.0)
    turned = inner[np.nanargmax(sharpness[inner])]
    assert turned + 1 == 20 + 60 + 1  # in the interval behind the highest sample
    assert share[turned] == pytest.approx(when, abs=0.01)
    assert sign * at[turned] == pytest.approx(0.0, abs=1e-9)
    assert sharpness[turned] == pytest.approx(2.0 * bend, rel=1e-6)
    assert heading[turned - 5] == sign
    assert heading[turned + 5] == -sign


def test_noise_is_no_motion():
    heading, share, _, _ = turns(np.random.default_rng(0).normal(0.0, NOISE, 300))
    assert not heading.any()
    assert (share < 0.0).all()


def test_a_motion_stops_where_it_gains_nothing_any_more():
    x = np.concatenate([np.zeros(20), 1e-6 * np.arange(1, 51), np.full(50, 50e-6)])
    heading, share, _, sharpness = turns(x)
    stopped = int(np.flatnonzero(share >= 0.0)[-1])
    assert abs(stopped + 1 - 69) <= 1
    assert share[stopped] == 1.0
    assert sharpness[stopped] == 0.0
    assert not heading[stopped + 1 :].any()


def test_slopes_are_one_sided_at_the_ends_and_a_single_sample_has_none():
    np.testing.assert_allclose(slope(np.array([0.0, 1.0, 4.0]), 0.5), [2.0, 4.0, 6.0])
    np.testing.assert_array_equal(slope(np.ones(1), TS), 0.0)
