"""Whitened sums against the dense covariance."""

import numpy as np
import pytest

from estimation.offline.whiten import sum_whitened

ENCODER, WHITE = VARIANCE = 0.4, 0.3
COUNT, COLUMNS = 40, 3


@pytest.fixture
def rows():
    return np.random.default_rng(3).normal(size=(COUNT, COLUMNS + 1))


def whitened(rows, used):
    return sum_whitened(rows, used, *VARIANCE, -1, 1.0)


def weigh(used):
    """Inverse covariance of all samples, shape (M, M); zero where they are not used."""
    second = np.eye(COUNT + 2)[:-2] - 2.0 * np.eye(COUNT + 2)[1:-1] + np.eye(COUNT + 2)[2:]
    whole = ENCODER * second @ second.T + WHITE * np.eye(COUNT)
    weight = np.zeros((COUNT, COUNT))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], used.astype(int), [0]])))
    for run in zip(edges[::2], edges[1::2], strict=True):
        inside = slice(*run)
        weight[inside, inside] = np.linalg.inv(whole[inside, inside])
    return weight


@pytest.fixture
def used():
    mask = np.ones(COUNT, dtype=bool)
    mask[[0, 12, 13, 30, -1]] = False
    return mask


def test_sums_are_those_under_the_dense_covariance(rows, used):
    normal, slope, chi, samples = whitened(rows, used)
    together = rows.T @ weigh(used) @ rows
    np.testing.assert_allclose(normal, together[:-1, :-1], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(slope, together[:-1, -1], rtol=1e-10, atol=1e-12)
    assert chi == pytest.approx(together[-1, -1])
    assert samples == COUNT - 5


def test_first_and_last_sample_never_count(rows, used):
    every = np.ones(COUNT, dtype=bool)
    inner = every.copy()
    inner[[0, -1]] = False
    assert whitened(rows, every)[2:] == whitened(rows, inner)[2:]


def test_errors_in_variables_take_the_noise_that_the_residual_shows_out_of_the_column(rows):
    """Acceleration = true + e: what the residual shows of e is its expectation given the residual.

    With a residual m e + white, that is cov(e, r) S^-1 r; `scale` is the unknown's over m.
    """
    used = np.ones(COUNT, dtype=bool)
    used[[0, 1, -2, -1]] = False
    scale, column = 1.7, 1
    second = np.eye(COUNT + 2)[:-2] - 2.0 * np.eye(COUNT + 2)[1:-1] + np.eye(COUNT + 2)[2:]
    shown = ENCODER * scale * second @ second.T @ weigh(used) @ rows[:, -1]
    expected = rows.copy()
    expected[2:-2, column] -= shown[2:-2]
    found = sum_whitened(rows.copy(), used, *VARIANCE, column, scale)
    for mine, theirs in zip(found, whitened(expected, used), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-12)
