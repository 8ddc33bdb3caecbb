"""Slip where the limit falls; the law as a whole: effects/test_equations.py."""

import math

import numpy as np
import pytest

from hil_sim.plant import Slip, slip_step


def test_a_limit_that_falls_below_the_force_is_approached_not_jumped_to():
    forces, slipping = np.array([3.0]), np.array([False])
    slip = Slip(1.0, 1e-9, 2.0, math.exp(-0.01))
    after = slip_step(forces, slipping, np.array([1.0]), slip, 1e5, 1)
    assert after == pytest.approx(2.0 + math.exp(-0.01), rel=1e-9)
