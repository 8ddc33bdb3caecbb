"""A rounded force as an interval: log-likelihood of a code, and what a line through codes says."""

import math

import numpy as np
import pytest

from estimation.rounding import SOFT, _code, refine

STEP, COUNT = 0.04, 80
SOFTNESS = SOFT * STEP


def log_likelihood(force):
    left, right = (-0.5 * STEP - force) / SOFTNESS, (0.5 * STEP - force) / SOFTNESS
    return math.log(0.5 * (math.erfc(left / math.sqrt(2)) - math.erfc(right / math.sqrt(2))))


@pytest.mark.parametrize("force", [-0.56, -0.5, -0.42, 0.38, 0.45, 0.5, 0.53])
def test_slope_and_curvature_are_those_of_the_codes_likelihood(force):
    h = 1e-3 * SOFTNESS
    here = force * STEP
    below, at, above = (log_likelihood(here + d) for d in (-h, 0.0, h))
    slope, curvature = _code(here, SOFTNESS, STEP)
    assert slope == pytest.approx((above - below) / (2 * h), rel=1e-4)
    assert curvature == pytest.approx(-(above - 2 * at + below) / h**2, rel=1e-3)


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
