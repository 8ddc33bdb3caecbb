"""The bounded solver against closed forms and scipy."""

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from estimation.least_squares import solve

FREE = (np.full(3, -np.inf), np.full(3, np.inf))


def normal(residual, jacobian):
    return jacobian.T @ jacobian, jacobian.T @ residual, float(residual @ residual)


def linear(matrix, data):
    return lambda p: normal(matrix @ p - data, matrix)


@pytest.fixture
def problem():
    rng = np.random.default_rng(3)
    return rng.normal(size=(40, 3)), rng.normal(size=40)


def test_linear_problem_is_the_bayes_posterior(problem):
    matrix, data = problem
    prior, information = np.array([0.3, -1.0, 2.0]), np.diag([4.0, 1.0, 0.25])
    solution = solve(linear(matrix, data), prior, information, *FREE)
    posterior = np.linalg.inv(information + matrix.T @ matrix)
    expected = posterior @ (information @ prior + matrix.T @ data)
    np.testing.assert_allclose(solution.value, expected, rtol=1e-10)
    np.testing.assert_allclose(solution.covariance, posterior, rtol=1e-10)
    assert solution.converged
    assert not solution.at_bound.any()


def test_bounds_as_scipy_has_them(problem):
    matrix, data = problem
    lower, upper = np.full(3, -0.02), np.full(3, 0.05)
    weak = 1e-9 * np.eye(3)
    solution = solve(linear(matrix, data), np.zeros(3), weak, lower, upper)
    expected = lsq_linear(matrix, data, (lower, upper), method="bvls").x
    np.testing.assert_allclose(solution.value, expected, atol=1e-7)
    assert solution.at_bound.any()


def test_nonlinear_problem_as_scipy_has_it():
    t = np.linspace(0.0, 2.0, 60)
    rng = np.random.default_rng(5)
    data = 2.0 * np.exp(-1.5 * t) + 0.3 + rng.normal(0, 0.01, 60)

    def residual(p):
        return (p[0] * np.exp(-p[1] * t) + p[2] - data) / 0.01

    def model(p):
        decay = np.exp(-p[1] * t)
        jacobian = np.column_stack([decay, -p[0] * t * decay, np.ones_like(t)]) / 0.01
        return normal(residual(p), jacobian)

    start = np.array([1.0, 0.7, 0.0])
    solution = solve(model, start, 1e-9 * np.eye(3), *FREE, tolerance=1e-8)
    expected = least_squares(residual, start).x
    np.testing.assert_allclose(solution.value, expected, rtol=1e-4)


def test_guess_changes_the_way_not_the_result(problem):
    matrix, data = problem
    information = np.eye(3)
    one = solve(linear(matrix, data), np.zeros(3), information, *FREE)
    other = solve(linear(matrix, data), np.zeros(3), information, *FREE, guess=np.full(3, 9.0))
    np.testing.assert_allclose(one.value, other.value, atol=1e-9)


def test_repeated_arrival_cost_is_a_kalman_filter():
    # One unknown that drifts, measured batch after batch: posterior -> prior with process noise.
    rng = np.random.default_rng(8)
    drift, noise = 0.1, 0.5
    mean, variance = 0.0, 4.0
    kalman_mean, kalman_variance = 0.0, 4.0
    lower, upper = np.array([-np.inf]), np.array([np.inf])
    for _ in range(30):
        data = rng.normal(1.0, noise, 7)
        variance += drift**2
        kalman_variance += drift**2
        matrix = np.full((7, 1), 1.0 / noise)
        solution = solve(
            linear(matrix, data / noise), np.array([mean]), np.array([[1.0 / variance]]),
            lower, upper,
        )  # fmt: skip
        mean, variance = float(solution.value[0]), float(solution.covariance[0, 0])
        for value in data:
            gain = kalman_variance / (kalman_variance + noise**2)
            kalman_mean += gain * (value - kalman_mean)
            kalman_variance *= 1.0 - gain
        assert mean == pytest.approx(kalman_mean, rel=1e-9)
        assert variance == pytest.approx(kalman_variance, rel=1e-9)


def test_not_finite_is_an_error():
    def model(_):
        return np.eye(3), np.zeros(3), float("nan")

    with pytest.raises(ValueError, match="not finite"):
        solve(model, np.zeros(3), np.eye(3), *FREE)
