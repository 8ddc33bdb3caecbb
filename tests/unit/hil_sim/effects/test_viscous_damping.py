"""Viscous friction, against an independent integration."""

from dataclasses import replace

from tests.unit.hil_sim.effects.closed_forms import (
    MASS,
    assert_close,
    every_step,
    integrated,
    motor,
)


@every_step
def test_viscous_damping(free, with_effects, effects, pushed, substeps, accuracy):
    oily = replace(
        free,
        axes=tuple(replace(a, friction=replace(a.friction, viscous=20.0)) for a in free.axes),
    )
    stage = with_effects(oily, effects["viscous_damping"].at(ratio=2.0))
    time, position, _ = pushed(stage, 20.0, substeps=substeps, duration=0.4)
    expected = integrated(time, lambda t, x, v: (motor(t, 20.0) - 40.0 * v) / MASS)
    assert_close(position, expected, accuracy)
