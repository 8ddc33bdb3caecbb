"""Figures of axis x and an independent integrator, for the tests of effects."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

MASS = 8.0
LAG = 1.0 / (2.0 * np.pi * 1500.0)
"""Time constant of the current loop [s]."""

both_steps = pytest.mark.parametrize("substeps", [5, 1])

every_step = pytest.mark.parametrize(
    ("substeps", "accuracy"), [(50, 1e-4), (5, 1.5e-3), (1, 1.5e-3)]
)


def integrated(time, acceleration, start=0.0):
    """Position of x'' = acceleration(t, x, v), an independent integration to 1e-10."""
    solution = solve_ivp(
        lambda t, s: (s[1], acceleration(t, s[0], s[1])), (0.0, time[-1]), (start, 0.0),
        t_eval=time, rtol=1e-10, atol=1e-14, max_step=1e-3,
    )  # fmt: skip
    return solution.y[0]


def motor(t, force):
    return force * (1.0 - math.exp(-t / LAG))


def assert_close(position, expected, accuracy):
    assert np.abs(position - expected).max() <= accuracy * np.ptp(expected)
