"""A move that the model explains badly counts for less: estimates stay within what they state."""

import numpy as np

from estimation.online.belief import Belief
from estimation.online.judge import temper

PRIOR = Belief(np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]), np.diag([0.36, 0.6, 0.6, 0.6, 1e-3, 1e-4]))


def found():
    covariance = np.diag([1e-2, 0.2, 4e-2, 0.6, 1e-3, 1e-4])
    covariance[0, 1] = covariance[1, 0] = -0.03
    return Belief(np.array([1.4, 2.0, 1.1, 1.0, 1.0, 0.0]), covariance)


def tempered(prior, belief, misfit):
    temper(prior, belief, misfit)
    return belief


def test_what_noise_explains_is_taken_as_it_is():
    for misfit in (0.7, 1.0):
        belief = tempered(PRIOR, found(), misfit)
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
