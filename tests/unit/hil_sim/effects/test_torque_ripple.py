"""Torque over the motor's angle, against an independent integration."""

import math

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_torque_ripple(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"ratio": 0.2, "pitch": 2.5e-3, "phase": 1.0}
    stage = with_effects(free, effects["torque_ripple"].at(**values))
    time, position, _ = pushed(stage, 6.0, substeps=substeps, duration=0.2)

    def acceleration(t, x, v):
        share = 1.0 + 0.2 * math.sin(2.0 * math.pi * x / 2.5e-3 + 1.0)
        return motor(t, 6.0) * share / MASS

    assert position[-1] > 4.0 * 2.5e-3
    assert_close(position, integrated(time, acceleration), accuracy)
