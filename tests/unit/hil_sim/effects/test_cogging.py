"""Detent force over position, against an independent integration."""

import math

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_cogging(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"amplitude": 2.0, "pitch": 24e-3, "phase": 0.4}
    stage = with_effects(free, effects["cogging"].at(**values))
    time, position, _ = pushed(stage, 6.0, substeps=substeps, duration=0.3)

    def acceleration(t, x, v):
        pull = 2.0 * math.sin(2.0 * math.pi * x / 24e-3 + 0.4)
        return (motor(t, 6.0) - pull) / MASS

    assert position[-1] > 24e-3
    assert_close(position, integrated(time, acceleration), accuracy)
