"""Feedforward from the friction state: continuity and timing."""

import numpy as np
import pytest

from estimation.friction import FrictionState, follow
from estimation.friction.feedforward import (
    friction_feedforward,
)
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TS = 1e-3
TRUE = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
MOVE = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))


def test_it_starts_without_a_jump_and_does_not_touch_the_state():
    state = FrictionState.relaxed(10)
    state.correct(-4.0, TRUE)
    before = state.forces.copy()
    force = friction_feedforward(TRUE, state, MOVE, 250, TS, 0.15e-3)
    assert abs(force[0]) < 0.05
    np.testing.assert_array_equal(state.forces, before)
    # After the slide: Coulomb force of this direction, over what there was.
    assert force[-1] == pytest.approx(4.0 + 6.6, abs=0.7)


def test_the_rest_of_a_move_is_the_same_from_the_middle():
    whole = friction_feedforward(TRUE, FrictionState.relaxed(10), MOVE, 250, TS, 0.15e-3)
    # The state at sample 120, by the demand itself.
    time = np.arange(1, 120 * 20 + 1) * TS / 20 + 0.15e-3
    position, velocity, _ = MOVE.sample(time)
    state = FrictionState.relaxed(10)
    follow(TRUE, state, position, velocity, TS / 20, 1, 0.0)
    before = state.forces.copy()
    rest = friction_feedforward(TRUE, state, MOVE, 250, TS, 0.15e-3, 120)
    np.testing.assert_allclose(rest, whole[120:] - whole[119], atol=0.02)
    np.testing.assert_array_equal(state.forces, before)
