"""The linearised error model against closed forms."""

import numpy as np
from scipy.linalg import expm

from sim2real.tracking.error_states import (
    STATES,
    discretise,
    fill_rate_matrix,
    propagate_covariance,
)

MASS = 12.0


def rates():
    matrix = np.zeros((STATES, STATES))
    fill_rate_matrix(matrix, MASS, 20.0, (2e5, 800.0), 4e5, 100.0, 6.0, 2.0)
    return matrix


def test_transition_and_inputs_are_those_of_the_matrix_exponential():
    matrix, duration, goal_rate = rates(), 1e-3, 600.0
    transition, force, level = np.zeros((STATES, STATES)), np.zeros(STATES), np.zeros(STATES)
    discretise(matrix, duration, transition, force, level, goal_rate, MASS)
    scale = np.array([1.0, 1e-3, 1e-6, 1e-6, 1e-6])  # forces count in meganewtons beside metres
    exact = expm(matrix * duration)
    np.testing.assert_allclose(
        transition * np.outer(scale, 1.0 / scale), exact * np.outer(scale, 1.0 / scale), atol=2e-3
    )
    augmented = np.zeros((STATES + 2, STATES + 2))
    augmented[:STATES, :STATES] = matrix
    augmented[1, STATES] = 1.0 / MASS
    augmented[3, STATES + 1] = goal_rate
    inputs = expm(augmented * duration)[:STATES, STATES:]
    np.testing.assert_allclose(force[:2], inputs[:2, 0], rtol=2e-2)
    np.testing.assert_allclose(level[3], inputs[3, 1], rtol=2e-2)


def test_covariance_is_propagated_and_stays_symmetric():
    rng = np.random.default_rng(2)
    root, transition = rng.standard_normal((2, STATES, STATES))
    covariance, noise = root @ root.T, np.arange(1.0, STATES + 1.0)
    expected = transition @ covariance @ transition.T + np.diag(noise)
    propagate_covariance(covariance, transition, noise)
    np.testing.assert_allclose(covariance, expected, rtol=1e-12)
    np.testing.assert_array_equal(covariance, covariance.T)
