"""The weight of an arm over its angle, against an independent integration."""

import math
from dataclasses import replace

import pytest

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_unbalance(free, with_effects, effects, pushed, substeps, accuracy):
    rotary = replace(free, axes=tuple(replace(axis, rotary=True) for axis in free.axes))
    stage = with_effects(rotary, effects["unbalance"].at(torque=20.0, phase=0.4))
    time, position, _ = pushed(stage, 12.0, substeps=substeps, duration=0.2)

    def acceleration(t, x, v):
        return (motor(t, 12.0) - 20.0 * math.sin(x + 0.4)) / MASS

    assert abs(position[-1]) > 0.01
    assert_close(position, integrated(time, acceleration), accuracy)


def test_only_what_turns_has_one(free, with_effects, effects, pushed):
    with pytest.raises(ValueError, match="axis x is not rotary"):
        pushed(with_effects(free, effects["unbalance"].at(torque=1.0, phase=0.0)), 1.0)
