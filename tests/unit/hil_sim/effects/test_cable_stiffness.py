"""A spring on the carriage, against an independent integration."""

import math

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step


@every_step
def test_cable_stiffness_swings_about_its_center(
    free, with_effects, effects, pushed, substeps, accuracy
):
    stage = with_effects(free, effects["cable_stiffness"].at(stiffness=30.0, center=0.01))
    time, position, _ = pushed(stage, 0.0, substeps=substeps, duration=2.0)
    expected = 0.01 * (1.0 - np.cos(math.sqrt(30.0 / MASS) * time))
    assert_close(position, expected, accuracy)
