"""Motor force that levels off, against an independent integration."""

import math

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_force_saturation(free, with_effects, effects, pushed, current, substeps, accuracy):
    stage = with_effects(free, effects["force_saturation"].at(force=45.0))
    time, position, force = pushed(stage, 80.0, substeps=substeps)

    def acceleration(t, x, v):
        return 45.0 * math.tanh(motor(t, 80.0) / 45.0) / MASS

    assert_close(position, integrated(time, acceleration), accuracy)
    np.testing.assert_allclose(force, 80.0 * current(time), atol=1e-6)
