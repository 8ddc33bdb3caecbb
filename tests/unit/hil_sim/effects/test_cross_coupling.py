"""Force from the other axis' acceleration, against the joint solution."""

import numpy as np
import pytest

from tests.unit.hil_sim.effects.closed_forms import MASS, assert_close, every_step, travelled


@every_step
@pytest.mark.parametrize("back", [0.0, -0.4])
def test_cross_coupling_is_solved_jointly(
    free, with_effects, effects, pushed, substeps, accuracy, back
):
    coupling = effects["cross_coupling"]
    y = (coupling.at(mass=back),) if back else ()
    stage = with_effects(free, coupling.at(mass=0.6), y=y)
    masses = np.array([[MASS, 0.6], [back, 14.0]])
    accelerations = np.linalg.solve(masses, [4.0, 30.0])
    for axis in range(2):
        time, position, _ = pushed(stage, 4.0, across=30.0, substeps=substeps, axis=axis)
        assert_close(position, travelled(time, accelerations[axis], 1.0), accuracy)
