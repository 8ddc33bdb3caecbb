"""A constant force, against the motion of a free mass."""

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step


@every_step
def test_force_offset(free, with_effects, effects, pushed, substeps, accuracy):
    stage = with_effects(free, effects["force_offset"].at(force=1.5))
    time, position, force = pushed(stage, 0.0, substeps=substeps)
    assert_close(position, -0.5 * 1.5 / MASS * time**2, accuracy)
    assert np.abs(force).max() < 1e-9
