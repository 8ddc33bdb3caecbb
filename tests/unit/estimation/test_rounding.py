"""A rounded force as an interval: what a code leaves, and what a line through codes says."""

import math

import numpy as np
import pytest

from estimation.rounding import _code, read_codes, refine

STEP, COUNT = 0.04, 80


@pytest.mark.parametrize(
    ("expected", "sigma"),
    [(-1.4, 0.3), (-0.56, 0.05), (-0.5, 2.0), (0.0, 0.05), (0.2, 0.3), (0.53, 0.05), (0.9, 2.0)],
)
def test_a_code_moves_mean_and_variance_as_the_integral_over_it_does(expected, sigma):
    inside = np.linspace(-0.5, 0.5, 20001)
    density = np.exp(-0.5 * ((inside - expected) / sigma) ** 2)
    density /= density.sum()
    mean = inside @ density
    variance = (inside - mean) ** 2 @ density
    moved, fallen = _code(expected * STEP, (sigma * STEP) ** 2, STEP)
    assert expected + moved / STEP == pytest.approx(mean, abs=1e-3)
    assert sigma**2 - fallen / STEP**2 == pytest.approx(variance, rel=2e-2)


def test_one_code_leaves_what_a_uniform_error_does():
    """A force of which nothing else is known: the middle of the code, step/sqrt(12) about it."""
    force, doubt = np.zeros(1), np.array([STEP**2 / 12.0])
    away, variance = np.array([0.3 * STEP]), np.array([STEP**2])
    for _ in range(60):
        others = 1.0 / (100.0 * STEP**2)
        doubt[0] = 1.0 / (1.0 / variance[0] + others)
        force[0] = doubt[0] * away[0] / variance[0]
        read_codes(force, doubt, STEP, away, variance)
    assert away[0] == pytest.approx(0.0, abs=1e-6 * STEP)
    assert variance[0] == pytest.approx(STEP**2 / 12.0, rel=1e-2)


def line(slope, number):
    """Offset and slope of a rounded line: errors of a plain and of the refined fit, and sigmas."""
    rng = np.random.default_rng(number)
    time = np.linspace(-1.0, 1.0, COUNT)
    true = rng.uniform(-1.0, 1.0) + slope * time
    measured = np.round(true / STEP) * STEP
    design = np.vstack([np.ones(COUNT), time])
    value = np.linalg.lstsq(design.T, measured, rcond=None)[0]
    plain = value - [true.mean(), slope]
    raw = np.vstack([design, value @ design - measured])
    at, n = value.copy(), 2
    prior, information = np.zeros(n), 1e-6 * np.eye(n)
    normal = np.empty((n + 1, n + 1))
    refine(
        raw, np.arange(n + 1), at, np.zeros(COUNT), np.zeros(COUNT), np.ones(COUNT, dtype=bool),
        1e-6, 0.0, 1e-3, 1e-10, STEP, prior, information, np.full(n, -9.0), np.full(n, 9.0), value,
        normal,
    )  # fmt: skip
    sigma = np.sqrt(np.linalg.inv(normal[:n, :n] + information).diagonal())
    return plain, value - [true.mean(), slope], sigma


@pytest.mark.parametrize("slope", [0.055, 0.11, 0.23])
def test_a_slow_line_is_found_better_than_by_least_squares_and_honestly(slope):
    plain, refined, sigma = map(np.array, zip(*(line(slope, k) for k in range(60)), strict=True))
    assert refined.std(axis=0)[1] < 0.8 * plain.std(axis=0)[1]
    inside = np.abs(refined) < 1.96 * sigma
    assert inside.mean() > 0.9


def test_a_plateau_does_not_average_out():
    """One and the same error eighty times: no figure, only borders."""
    _, refined, sigma = map(np.array, zip(*(line(0.0, k) for k in range(40)), strict=True))
    assert (np.abs(refined[:, 0]) < 0.55 * STEP).all()
    assert sigma[:, 0].min() > 1.5 * STEP / math.sqrt(12.0 * COUNT)
