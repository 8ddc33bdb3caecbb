"""What a move counts for: noise larger than assumed, and figures that are not quite the axis'."""

import numpy as np
import pytest

from estimation.online.belief.belief import Belief
from estimation.online.belief.scatter import learn_scatter, temper
from estimation.online.estimator import SplitHorizonEstimator
from tests.unit.estimation.online.moves import SEQUENCE, TRUE, drive, learn
from tests.unit.estimation.online.test_unmodelled_force import AS_IN_A_RUN, stage

PRIOR = Belief(np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]), np.diag([0.36, 0.6, 0.6, 0.6, 1e-3, 1e-4]))


def found():
    covariance = np.diag([1e-2, 0.2, 4e-2, 0.6, 1e-3, 1e-4])
    covariance[0, 1] = covariance[1, 0] = -0.03
    return Belief(np.array([1.4, 2.0, 1.1, 1.0, 1.0, 0.0]), covariance)


def tempered(prior, belief, misfit):
    shown = temper(prior, prior, belief, misfit)
    np.testing.assert_array_equal(shown, 0.0)
    return belief


def test_what_noise_explains_is_taken_as_it_is():
    belief = tempered(PRIOR, found(), 1.0)
    np.testing.assert_array_equal(belief.mean, found().mean)
    np.testing.assert_array_equal(belief.covariance, found().covariance)


def test_a_misfit_is_noise_that_much_larger():
    belief = tempered(PRIOR, found(), 3.0)
    information = np.linalg.inv(PRIOR.covariance[:3, :3])
    data = (np.linalg.inv(found().covariance[:3, :3]) - information) / 9.0
    got = np.linalg.inv(belief.covariance[:3, :3])
    np.testing.assert_allclose(got, information + data, rtol=1e-9, atol=1e-9)
    information_after = np.linalg.inv(found().covariance[:3, :3]) @ found().mean[:3]
    pull = information @ PRIOR.mean[:3] + (information_after - information @ PRIOR.mean[:3]) / 9.0
    np.testing.assert_allclose(got @ belief.mean[:3], pull, rtol=1e-9)
    assert belief.covariance[0, 0] > found().covariance[0, 0]
    np.testing.assert_array_equal(belief.mean[3:], PRIOR.mean[3:])


def test_nonsense_says_nothing():
    belief = tempered(PRIOR, found(), 1e6)
    np.testing.assert_allclose(belief.mean, PRIOR.mean, atol=1e-6)
    np.testing.assert_allclose(belief.covariance, PRIOR.covariance, rtol=1e-6, atol=1e-9)


def test_figures_of_a_move_say_of_the_axis_what_their_scatter_allows():
    """As an observation of the axis' figures with scatter and noise, by Kalman's equations."""
    generator = np.random.default_rng(5)
    spread = generator.normal(size=(6, 6))
    before = Belief(np.ones(6), spread @ spread.T + np.eye(6))
    deviations = np.array([0.0, 0.5, 2.0, 0.0, 0.0, 0.0])
    own = before.covariance + np.diag(deviations**2)
    noise, seen = np.diag(generator.uniform(0.1, 1.0, 6)), generator.normal(size=6)

    after = Belief(*observe(before.mean, own, noise, seen))
    shown = temper(before, Belief(before.mean, own), after, 1.0)

    mean, covariance = observe(
        before.mean, before.covariance, own - before.covariance + noise, seen
    )
    np.testing.assert_allclose(after.mean, mean, rtol=1e-9)
    np.testing.assert_allclose(after.covariance, covariance, atol=1e-9)
    precision = np.linalg.inv(own + noise)
    left = precision @ (seen - before.mean)
    for figure in (1, 2):
        assert shown[0, figure] == pytest.approx((deviations[figure] * left[figure]) ** 2)
        known = deviations[figure] ** 2 * precision[figure, figure]
        assert shown[1, figure] == pytest.approx(known)
    np.testing.assert_array_equal(shown[:, [0, 3]], 0.0)


def observe(mean, covariance, noise, seen):
    gain = covariance @ np.linalg.inv(covariance + noise)
    return mean + gain @ (seen - mean), covariance - gain @ covariance


def test_scatter_is_the_rms_of_what_moves_show():
    scatter, weights = np.array([0.0, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]), np.full(4, 0.3)
    least = np.full(7, 0.004)
    for _ in range(40):
        shown = np.array([[0.0, 0.0, (0.3 / scatter[2]) ** 2, 0.0], [0.0, 1.0, 1.0, 0.0]])
        learn_scatter(shown, scatter, weights, least, 15.0)
    # Moves that agree; moves 0.3 apart from the axis; moves that say nothing.
    np.testing.assert_allclose(scatter[1:4], [0.0, 0.3, 0.1], atol=0.01)
    np.testing.assert_array_equal(scatter[[0, 4, 5, 6]], 0.0)


@pytest.mark.parametrize("ratio", [0.3, -0.3])
def test_moves_in_one_direction_do_not_know_the_other(ratio):
    """Viscous friction that differs with the direction was a third off at 14 sigma."""
    data = drive(SEQUENCE * 2, stage(("viscous_asymmetry", {"ratio": ratio})))
    estimates = learn(SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN), data)
    assert sum(estimate.accepted for estimate in estimates) >= 14
    for estimate in estimates[2:]:  # from the way back on
        assert abs(estimate.friction.viscous - 20.0) < 4.0 * estimate.sigma["viscous"]
    assert estimates[-1].friction.viscous == pytest.approx(20.0, rel=0.2)


def test_without_scatter_it_is_learned_that_there_is_none():
    estimator = SplitHorizonEstimator(TRUE, AS_IN_A_RUN)
    learn(estimator, drive(SEQUENCE * 2))
    assert estimator.sigma["viscous"] < 0.04 * TRUE.viscous
    # Beside 4 % is what the shape of the hysteresis leaves open.
    assert estimator.sigma["stiffness"] < 0.065 * TRUE.stiffness


def test_the_estimator_states_the_sigma_of_its_last_estimate():
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), AS_IN_A_RUN)
    for estimate in learn(
        estimator, drive(SEQUENCE, stage(("friction_asymmetry", {"ratio": 0.2})))
    ):
        last = estimate
    assert last.accepted
    assert estimator.sigma == pytest.approx(last.sigma)
