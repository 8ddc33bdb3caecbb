"""A sinusoidal force over time, against an independent integration."""

import math

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step


@every_step
def test_floor_vibration(free, with_effects, effects, pushed, substeps, accuracy):
    values = {"amplitude": 0.6, "frequency": 37.0, "phase": 0.9}
    stage = with_effects(free, effects["floor_vibration"].at(**values))
    time, position, _ = pushed(stage, 0.0, substeps=substeps, duration=0.5)
    w = 2.0 * math.pi * 37.0
    expected = (
        0.6
        / MASS
        * (np.sin(w * time + 0.9) / w**2 - math.sin(0.9) / w**2 - math.cos(0.9) / w * time)
    )
    assert_close(position, expected, 4 * accuracy)
