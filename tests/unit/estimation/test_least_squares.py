"""The compiled parts of the solver against closed forms and scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from estimation.least_squares import cholesky_inverse, gauss_newton_step

WIDE = 1e9


def step(matrix, data, prior, information, value=None, lower=-WIDE, upper=WIDE):
    n = len(prior)
    value = np.zeros(n) if value is None else value
    residual = matrix @ value - data
    return gauss_newton_step(
        matrix.T @ matrix, matrix.T @ residual, information, prior, value,
        np.full(n, float(lower)), np.full(n, float(upper)),
    )  # fmt: skip


@pytest.fixture
def problem():
    rng = np.random.default_rng(3)
    return rng.normal(size=(40, 3)), rng.normal(size=40)


def test_one_step_solves_a_linear_problem_to_the_bayes_posterior(problem):
    matrix, data = problem
    prior, information = np.array([0.3, -1.0, 2.0]), np.diag([4.0, 1.0, 0.25])
    start = np.array([5.0, 5.0, -3.0])
    found, size = step(matrix, data, prior, information, start)
    normal = information + matrix.T @ matrix
    expected = np.linalg.solve(normal, information @ prior + matrix.T @ data)
    np.testing.assert_allclose(start + found, expected, rtol=1e-10)
    assert size == pytest.approx(np.sqrt(found @ normal @ found))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), low=st.floats(-0.5, -0.01), high=st.floats(0.01, 0.5))
def test_bounds_as_scipy_has_them(seed, low, high):
    rng = np.random.default_rng(seed)
    matrix, data = rng.normal(size=(30, 4)), rng.normal(size=30)
    information = 1e-9 * np.eye(4)
    found, _ = step(matrix, data, np.zeros(4), information, None, low, high)
    best = lsq_linear(matrix, data, (low, high), method="bvls")
    assert (found >= low - 1e-12).all()
    assert (found <= high + 1e-12).all()
    cost = 0.5 * np.sum((matrix @ found - data) ** 2)
    assert cost <= best.cost * (1 + 1e-6) + 1e-9


def test_a_bound_that_is_hit_holds_the_variable_on_it(problem):
    matrix, data = problem
    free, _ = step(matrix, data, np.zeros(3), 1e-9 * np.eye(3))
    limit = 0.5 * np.abs(free).max()
    found, _ = step(matrix, data, np.zeros(3), 1e-9 * np.eye(3), None, -limit, limit)
    worst = np.argmax(np.abs(free))
    assert abs(found[worst]) == limit


def test_no_minimum_says_so():
    found, size = gauss_newton_step(
        -np.eye(2), np.ones(2), np.zeros((2, 2)), np.zeros(2), np.zeros(2),
        np.full(2, -1.0), np.full(2, 1.0),
    )  # fmt: skip
    assert np.isnan(size)
    assert not found.any()


def test_inverse(problem):
    matrix, _ = problem
    normal = matrix.T @ matrix
    inverse = normal.copy()
    assert cholesky_inverse(inverse)
    np.testing.assert_allclose(inverse, np.linalg.inv(normal), rtol=1e-10)
    assert not cholesky_inverse(np.array([[1.0, 2.0], [2.0, 1.0]]))


def test_repeated_arrival_cost_is_a_kalman_filter():
    # One unknown that drifts, measured batch after batch: posterior -> prior with process noise.
    rng = np.random.default_rng(8)
    drift, noise = 0.1, 0.5
    mean, variance = 0.0, 4.0
    kalman_mean, kalman_variance = 0.0, 4.0
    for _ in range(30):
        data = rng.normal(1.0, noise, 7)
        variance += drift**2
        kalman_variance += drift**2
        matrix, information = np.full((7, 1), 1.0 / noise), np.array([[1.0 / variance]])
        found, _ = step(matrix, data / noise, np.array([mean]), information, np.array([mean]))
        mean += float(found[0])
        covariance = information + matrix.T @ matrix
        assert cholesky_inverse(covariance)
        variance = float(covariance[0, 0])
        for value in data:
            gain = kalman_variance / (kalman_variance + noise**2)
            kalman_mean += gain * (value - kalman_mean)
            kalman_variance *= 1.0 - gain
        assert mean == pytest.approx(kalman_mean, rel=1e-9)
        assert variance == pytest.approx(kalman_variance, rel=1e-9)
