"""Friction at creep speed, against an independent integration."""

import math
from dataclasses import replace

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_low_speed_friction(free, with_effects, effects, pushed, substeps, accuracy):
    # Fc as a level only: elements this soft never reach it.
    axes = tuple(replace(a, friction=replace(a.friction, coulomb=6.0)) for a in free.axes)
    rubbing = replace(free, axes=axes)
    stage = with_effects(rubbing, effects["low_speed_friction"].at(ratio=0.5, speed=0.02))
    time, position, _ = pushed(stage, 12.0, substeps=substeps, duration=0.05)

    def acceleration(t, x, v):
        drag = 3.0 * math.tanh(5.0 * v / 0.02) * math.exp(-abs(v) / 0.02)
        return (motor(t, 12.0) - drag) / MASS

    assert_close(position, integrated(time, acceleration), accuracy)


def test_usual_speeds_follow_what_the_axis_can_do(nominal, effects):
    """A joint that turns at 3 rad/s has its low speeds elsewhere than a slide of 1 m/s."""
    speed = effects["low_speed_friction"].parameters[1]
    axis = nominal.axes[0]
    (slide,), (joint,) = (speed.ranges(replace(axis, velocity=v)) for v in (1.0, 3.0))
    assert slide == (2e-3, 4e-2)
    assert joint == (6e-3, 0.12)
