"""Motor force over position, against an independent integration."""

import math

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_force_ripple(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"ratio": 0.08, "pitch": 9e-3, "phase": 1.1}
    stage = with_effects(free, effects["force_ripple"].at(**values))
    time, position, _ = pushed(stage, 40.0, substeps=substeps)

    def acceleration(t, x, v):
        return motor(t, 40.0) * (1.0 + 0.08 * math.sin(2.0 * math.pi * x / 9e-3 + 1.1)) / MASS

    assert position[-1] > 2 * 9e-3
    assert_close(position, integrated(time, acceleration), accuracy)
