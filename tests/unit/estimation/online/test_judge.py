"""Figures to which a move adds less than a twentieth of what was known stay as they were."""

import numpy as np
import pytest

from estimation.online.belief.belief import COULOMB, LEVEL, STATES, VISCOUS, Belief
from estimation.online.judge import hold_undetermined
from estimation.online.settings import EstimatorSettings
from stagedata import FrictionFigures

FRICTION = FrictionFigures(4, 8.0, 12.0, 1.5e6, 250.0, 0.3, 2e-3, 1.0)
AXIS = EstimatorSettings(8.0, 1e-3, 1e-9, 0.01).axis(FRICTION)


@pytest.mark.parametrize(("gain", "stays"), [(1.045, True), (1.055, False)])
def test_a_figure_that_hardly_gains_is_held(gain, stays):
    before = Belief(np.ones(STATES), np.eye(STATES))
    after = Belief(np.ones(STATES), np.eye(STATES))
    after.mean[VISCOUS] = after.mean[COULOMB] = 1.5
    after.covariance[VISCOUS, VISCOUS] = 1.0 / gain
    after.covariance[COULOMB, COULOMB] = 0.01
    mask = np.zeros(LEVEL, np.int8)
    mask[[COULOMB, VISCOUS]] = 1
    held = hold_undetermined(AXIS, mask, before, after)
    assert (bool(held[VISCOUS]), bool(held[COULOMB])) == (stays, False)
    assert after.mean[VISCOUS] == (1.0 if stays else 1.5)
    assert after.mean[COULOMB] == 1.5
