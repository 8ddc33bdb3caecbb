"""From a machine file to the estimator's settings."""

import math

import pytest

from estimation.online import FIGURES
from stagectl.config import load_machine
from stagectl.config.settings.host_model import SETTLED_DRIFT, estimator_settings, kink_delay


def test_with_a_map_drift_is_slower_except_for_parameters_that_it_names():
    axis = load_machine().axes["x"]
    name = FIGURES[1]
    drift = estimator_settings(axis, 1e-3, {name: 0.25}).belief.drift
    assert drift == (SETTLED_DRIFT[0], 0.25, *SETTLED_DRIFT[2:])
    alone = estimator_settings(axis, 1e-3).belief.drift
    assert all(fast >= slow for fast, slow in zip(alone, SETTLED_DRIFT, strict=True))


def test_a_kink_comes_with_the_current_loops_lag_less_half_a_control_tick():
    drive = load_machine().axes["x"].drive
    assert kink_delay(drive) == pytest.approx(1 / (2 * math.pi * 1500.0) - 0.5e-4)
