"""The current loop's lag, against its step response."""

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import every_step


@every_step
def test_current_bandwidth(free, with_effects, effects, pushed, current, substeps, accuracy):
    stage = with_effects(free, effects["current_bandwidth"].at(bandwidth=180.0))
    time, _, force = pushed(stage, 4.0, substeps=substeps, duration=0.01)
    np.testing.assert_allclose(force, 4.0 * current(time, bandwidth=180.0), atol=1e-9)
