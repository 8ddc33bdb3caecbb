"""Presliding stiffness, against a spring."""

import math
from dataclasses import replace

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import both_steps


@both_steps
def test_presliding_stiffness_is_a_spring(nominal, with_effects, effects, pushed, substeps):
    # Far below the first element's limit friction is a spring sigma0 * ratio: with open loops the
    # mass swings on it between 0 and twice the static deflection.
    open_loop = replace(
        nominal,
        axes=tuple(
            replace(
                a,
                control=replace(a.control, kp=1e-9, ki=0.0, kd=0.0),
                friction=replace(a.friction, viscous=0.0),
                increment=1e-13,
            )
            for a in nominal.axes
        ),
    )
    stage = with_effects(open_loop, effects["presliding_stiffness"].at(ratio=0.5))
    time, position, _ = pushed(stage, 0.05, substeps=substeps, duration=0.1)
    rate = math.sqrt(0.5 * 6e5 / 8.0)
    late = np.maximum(time - 1.0 / (2.0 * math.pi * 1500.0), 0.0)
    expected = 0.05 / 3e5 * (1.0 - np.cos(rate * late))
    np.testing.assert_allclose(position, expected, atol=0.02 * 0.05 / 3e5)
