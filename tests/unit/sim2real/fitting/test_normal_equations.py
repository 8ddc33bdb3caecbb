"""Normal equations in any units, without directions that only error leaves."""

import numpy as np
import pytest

from sim2real.fitting import NUISANCES
from sim2real.fitting.normal_equations import (
    information_matrix,
    invert_scaled,
    sandwich_covariance,
    solve_scaled,
)

RNG = np.random.default_rng(3)
JACOBIAN = RNG.standard_normal((2000, NUISANCES + 2))
UNITS = 10.0 ** np.linspace(-9, 6, NUISANCES + 2)


def test_solution_and_covariance_do_not_depend_on_units():
    gradient = RNG.standard_normal(NUISANCES + 2)
    normal = JACOBIAN.T @ JACOBIAN
    scaled = normal * np.outer(UNITS, UNITS)
    expected = np.linalg.solve(normal, gradient)
    np.testing.assert_allclose(solve_scaled(scaled, UNITS * gradient) * UNITS, expected, rtol=1e-6)
    covariance = invert_scaled(scaled) * np.outer(UNITS, UNITS)
    np.testing.assert_allclose(covariance, np.linalg.inv(normal), rtol=1e-5, atol=1e-9)


def test_independent_columns_keep_all_their_information():
    gradient = RNG.standard_normal(NUISANCES + 2)
    known, kept = information_matrix(JACOBIAN, gradient, [2])
    np.testing.assert_allclose(known, JACOBIAN.T @ JACOBIAN, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(kept, gradient, rtol=1e-6)


def test_a_direction_in_which_columns_cancel_carries_no_information():
    jacobian = JACOBIAN.copy()
    jacobian[:, NUISANCES] = jacobian[:, 0] + 1e-3 * RNG.standard_normal(len(jacobian))
    known, _ = information_matrix(jacobian, np.zeros(NUISANCES + 2), [1, 1])
    cancelling = np.zeros(NUISANCES + 2)
    cancelling[[0, NUISANCES]] = (1.0, -1.0)
    together = np.abs(cancelling)
    assert cancelling @ known @ cancelling < 1e-3 * (together @ known @ together)


def test_correlated_remainders_widen_the_covariance():
    covariance = np.array([[0.01]])
    white = RNG.standard_normal((5000, 1))
    slow = np.repeat(RNG.standard_normal((20, 1)), 250, axis=0)
    narrow, wide = (sandwich_covariance(covariance, scores)[0, 0] for scores in (white, slow))
    assert narrow == pytest.approx(0.01 + 1e-4 * 5000, rel=0.8)
    assert wide > 50.0 * narrow
