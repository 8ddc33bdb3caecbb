"""Viscous friction by direction, against an independent integration."""

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
@pytest.mark.parametrize("push", [20.0, -20.0])
def test_viscous_asymmetry(free, with_effects, effects, pushed, push, substeps, accuracy):
    oily = replace(
        free,
        axes=tuple(replace(a, friction=replace(a.friction, viscous=40.0)) for a in free.axes),
    )
    stage = with_effects(oily, effects["viscous_asymmetry"].at(ratio=0.25))
    time, position, _ = pushed(stage, push, substeps=substeps, duration=0.4)
    coefficient = 50.0 if push > 0.0 else 30.0
    expected = integrated(time, lambda t, x, v: (motor(t, push) - coefficient * v) / MASS)
    assert_close(position, expected, accuracy)
