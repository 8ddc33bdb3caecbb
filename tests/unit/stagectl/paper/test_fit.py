"""The paper's Gauss-Newton on data of its own model, and on the plant's."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stagectl.paper import Case, published
from stagectl.paper.fit import ALPHA, METHODS, TOTAL, fit, one_window, two_windows, zone_a
from stagectl.paper.published import PARAMETERS
from stagectl.paper.tables import error

BOTH = pytest.mark.parametrize("method", METHODS)


def start(*factors):
    return tuple(f * v for f, v in zip(factors, published.REFERENCE.values(), strict=True))


@pytest.fixture(scope="module")
def own(move):
    """The plant's motion with the force that the one-window model would predict for it."""
    found = one_window(move)
    force = move.force.copy()
    force[move.slide : move.end] = found.predicted
    return replace(move, force=force), found


def test_one_window_finds_its_own_parameters(own):
    move, truth = own
    found = one_window(move, Case(start=start(0.3, 0.7, 0.5, 1.5)))
    for name in PARAMETERS:
        assert found.value[name] == pytest.approx(truth.value[name], rel=1e-6)
    assert found.mse < 1e-16


def test_two_windows_find_zone_a_of_their_own(own):
    move, truth = own
    found = two_windows(move)
    for name in ("coulomb", "attraction", "viscous"):
        assert found.value[name] == pytest.approx(truth.value[name], rel=1e-5)
    assert found.value["stiffness"] == pytest.approx(truth.value["stiffness"], rel=2e-3)


@BOTH
@settings(max_examples=15, deadline=None)
@given(factors=st.lists(st.floats(0.3, 3.0), min_size=4, max_size=4))
def test_first_iterate_does_not_matter(move, method, factors):
    found = METHODS[method](move, Case(start=start(*factors)))
    for name, tolerance in zip(PARAMETERS, (1e-5, 1e-2, 1e-4, 2e-3), strict=True):
        assert error(found, name) == pytest.approx(0.0, abs=tolerance)


def test_evaluations_are_one_per_unknown_and_one_per_trial(move):
    one, two = one_window(move), two_windows(move)
    assert one.evaluations == (1 + one.iterations[0] * 5,)
    assert two.evaluations == (1 + two.iterations[0] * 4, 1 + two.iterations[1] * 2)


@pytest.mark.parametrize("initial", ["reference", "measured"])
def test_an_initial_force_that_does_not_follow_fc_is_what_zone_a_begins_with(move, initial):
    start = np.array([1.0, 2.0, 0.5, 500.0])
    found = zone_a(move, start, Case(initial=initial))
    first = move.slide
    inertia = published.MASS * move.acceleration[first]
    slip = 2.0 * (1 + 0.5 * np.exp(-move.velocity[first] / published.STRIBECK_VELOCITY))
    left = move.force[first] - inertia - found.value[2] * move.velocity[first]
    assert found.value[TOTAL] == pytest.approx(slip if initial == "reference" else left)
    assert found.predicted[0] == pytest.approx(
        inertia + found.value[TOTAL] + found.value[2] * move.velocity[first]
    )


def test_a_parameter_of_which_the_window_says_nothing_has_an_infinite_deviation(move):
    """Where C is almost 0, slipping elements keep their force, and Fc changes nothing."""
    case = Case(initial="reference", slide=(0,))
    found = zone_a(move, np.array([1.0, 1e-30, 1.0, 1000.0]), case)
    assert np.isinf(found.variance[0])


def test_zone_a_does_not_see_sigma0(move):
    wrong = [
        zone_a(move, np.array([1.0, 2.0, 0.5, stiffness])).value[:3] for stiffness in (1e2, 1e4)
    ]
    np.testing.assert_array_equal(*wrong)


def test_deviation_is_the_spread_where_the_force_carries_white_noise(own):
    move, _ = own
    rng = np.random.default_rng(4)
    noisy = [
        one_window(replace(move, force=move.force + 1e-4 * rng.standard_normal(len(move.force))))
        for _ in range(120)
    ]
    for name in PARAMETERS:
        spread = np.std([fit.value[name] for fit in noisy])
        stated = np.mean([fit.sigma[name] for fit in noisy])
        assert 0.8 < spread / stated < 1.25, name


def test_estimates_stay_above_the_bound_where_the_data_pulls_below():
    """A filter on velocity and acceleration alone pulls C below zero."""
    found = fit(Case(cut_off=50.0, filter_force=False), "two_windows")
    assert 0 < found.value["attraction"] < 1e-4
    assert found.value["coulomb"] == pytest.approx(2.0, rel=0.01)


def test_alpha_is_estimated_on_request(move):
    found = two_windows(move, Case(slide=(0, 2, ALPHA), start=start(0.5, 1.0, 0.5, 0.5)))
    assert found.value["static_ratio"] == pytest.approx(published.STATIC_RATIO, rel=0.02)
    assert "attraction" not in found.value
