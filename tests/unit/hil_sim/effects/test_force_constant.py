"""Motor force per measured force, against the motion of a free mass."""

import numpy as np

from tests.unit.hil_sim.effects.closed_forms import assert_close, every_step, travelled


@every_step
def test_force_constant_moves_but_does_not_show(
    free, with_effects, effects, pushed, current, substeps, accuracy
):
    stage = with_effects(free, effects["force_constant"].at(ratio=1.08))
    time, position, force = pushed(stage, 4.0, substeps=substeps)
    assert_close(position, travelled(time, 4.0 * 1.08), accuracy)
    np.testing.assert_allclose(force, 4.0 * current(time), atol=1e-9)
