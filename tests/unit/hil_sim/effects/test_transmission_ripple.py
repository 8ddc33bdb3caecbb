"""A force that repeats with the lead, against an independent integration."""

import math

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_transmission_ripple(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"amplitude": 2.0, "pitch": 2.5e-3, "phase": 0.4}
    stage = with_effects(free, effects["transmission_ripple"].at(**values))
    time, position, _ = pushed(stage, 6.0, substeps=substeps, duration=0.2)

    def acceleration(t, x, v):
        pull = 2.0 * math.sin(2.0 * math.pi * x / 2.5e-3 + 0.4)
        return (motor(t, 6.0) - pull) / MASS

    assert position[-1] > 4.0 * 2.5e-3
    assert_close(position, integrated(time, acceleration), accuracy)
