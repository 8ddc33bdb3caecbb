"""Jerk-limited setpoints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.trajectory import Limits, duration, plan, plan_stop

MACRO, MICRO = Limits(0.5, 3.0, 200.0), Limits(0.01, 0.2, 20.0)


@settings(max_examples=60, deadline=None)
@given(
    start=st.floats(-0.15, 0.15),
    distance=st.floats(-0.2, 0.2).filter(lambda d: abs(d) > 1e-9),
    limits=st.sampled_from([MACRO, MICRO]),
)
def test_rest_to_rest_within_limits(start, distance, limits):
    motion = plan(start, start + distance, limits)
    t = np.linspace(0.0, motion.duration, 2001)
    x, v, a = motion.sample(t)
    assert x[0] == pytest.approx(start, abs=1e-12)
    assert x[-1] == start + distance
    assert np.abs(v).max() <= limits.velocity * (1 + 1e-9)
    assert np.abs(a).max() <= limits.acceleration * (1 + 1e-9)
    assert np.abs(np.diff(a)).max() <= limits.jerk * (t[1] - t[0]) * (1 + 1e-6) + 1e-9
    heading = np.sign(distance)
    assert (np.diff(x) * heading >= -1e-12).all()  # no overshoot


def test_derivatives_fit_together():
    motion = plan(0.0, 0.025, MACRO)
    t = np.arange(0.0, motion.duration, 1e-5)
    x, v, a = motion.sample(t)
    np.testing.assert_allclose(np.gradient(x, t)[2:-2], v[2:-2], atol=2e-6)
    np.testing.assert_allclose(np.gradient(v, t)[2:-2], a[2:-2], atol=2e-3)


def test_before_and_after_it_is_at_rest():
    motion = plan(1e-3, 2e-3, MICRO)
    x, v, a = motion.sample(np.array([-1.0, motion.duration, motion.duration + 5.0]))
    assert x.tolist() == [1e-3, 2e-3, 2e-3]
    assert not v.any()
    assert not a.any()


def test_samples_may_be_in_any_order_and_shape():
    motion = plan(0.0, 0.025, MACRO)
    t = np.linspace(-0.01, motion.duration + 0.01, 200)
    mixed = np.random.default_rng(1).permutation(t).reshape(20, 10)
    for straight, other in zip(motion.sample(t), motion.sample(mixed), strict=True):
        np.testing.assert_array_equal(straight[np.searchsorted(t, mixed)], other)


def test_nothing_to_do_takes_no_time():
    motion = plan(0.3, 0.3, MACRO)
    assert motion.duration == 0.0
    assert motion.sample(np.zeros(1))[0][0] == 0.3


def test_duration_of_a_known_move():
    # 25 mm, 3 m/s^2, 200 m/s^3, speed not reached: T = tj + sqrt(tj^2 + 4 d/a), tj = a/j.
    jerk_time = 3.0 / 200.0
    expected = jerk_time + np.sqrt(jerk_time**2 + 4 * 0.025 / 3.0)
    assert duration(0.025, 0.5, 3.0, 200.0) == pytest.approx(expected, rel=1e-9)


@settings(max_examples=60, deadline=None)
@given(velocity=st.floats(-0.5, 0.5), acceleration=st.floats(-3.0, 3.0))
def test_stop_from_a_moving_state(velocity, acceleration):
    stop = plan_stop(0.01, velocity, acceleration, MACRO)
    x, v, a = stop.sample(np.array([0.0, stop.duration - 1e-9, stop.duration]))
    assert x[0] == pytest.approx(0.01, abs=1e-12)
    assert abs(v[1]) < 1e-6
    assert v[2] == a[2] == 0.0
    assert x[2] == stop.target
    assert abs(stop.target - 0.01) < 0.1


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_not_finite_is_refused(bad):
    with pytest.raises(ValueError, match="finite"):
        plan(0.0, bad, MACRO)
    with pytest.raises(ValueError, match="velocity"):
        Limits(bad, 1.0, 1.0)
