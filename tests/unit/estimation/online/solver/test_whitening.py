"""Weights of the rows against dense matrices."""

import numpy as np
import pytest

from estimation.online.solver.whitening import (
    factor_weights,
    make_weights,
    normal_equations,
    whiten,
)

TS, MASS, VISCOUS, NOISE = 1e-3, 8.0, 20.0, 2e-9
COUNT = 60


def weights(stuck, white, use):
    made = make_weights(COUNT)
    factor_weights(MASS, VISCOUS, TS, NOISE, stuck, white, use, made)
    return made


def dense(stuck, white):
    """Covariance of the rows; the first position has an unknown of its own."""
    by_position = np.zeros((COUNT, COUNT + 2))
    for k in range(COUNT):
        by_position[k, k] = MASS / TS**2 - VISCOUS / (2 * TS)
        by_position[k, k + 1] = stuck[k] - 2 * MASS / TS**2
        by_position[k, k + 2] = MASS / TS**2 + VISCOUS / (2 * TS)
    by_position[:, 0] = 0.0
    return NOISE**2 * by_position @ by_position.T + np.diag(white)


@pytest.mark.parametrize("white", [1e-12, 1e-4])
def test_weights_are_those_of_the_dense_covariance(white):
    rng = np.random.default_rng(1)
    stuck = np.where(np.arange(COUNT) < 20, 6e5, 0.0)
    noise = np.full(COUNT, white)
    noise[25] *= 50.0
    use = np.ones(COUNT, dtype=bool)
    use[[30, 31, 32]] = False
    columns = rng.normal(size=(3, COUNT))
    kept = np.flatnonzero(use)
    expected = columns[:, kept] @ np.linalg.solve(
        dense(stuck, noise)[np.ix_(kept, kept)], columns[:, kept].T
    )
    made = weights(stuck, noise, use)
    chosen = np.arange(3)
    whiten(columns, chosen, made)
    found = np.empty((3, 3))
    normal_equations(columns, chosen, made, found)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
