"""Delay before the current loop, in fractions of a control tick."""

import numpy as np
import pytest

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step


@every_step
@pytest.mark.parametrize("delay", [0.0002, 0.000537, 0.0031])
def test_dead_time(free, with_effects, effects, pushed, current, substeps, accuracy, delay):
    slow = effects["current_bandwidth"].at(bandwidth=200.0)
    stage = with_effects(free, effects["dead_time"].at(delay=delay), slow)
    time, position, force = pushed(stage, 4.0, substeps=substeps, duration=0.05)
    np.testing.assert_allclose(force, 4.0 * current(time, delay, 200.0), atol=1e-9)
    lag = 1.0 / (2.0 * np.pi * 200.0)
    since = np.maximum(time - delay, 0.0)
    expected = 0.5 / MASS * (since**2 - 2.0 * lag * (since - lag * (1.0 - np.exp(-since / lag))))
    assert_close(position, 4.0 * expected, 2 * accuracy)
