"""Every friction law keeps the contract: sensitivities, state at the end, at-rest correction."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, count_states, follow
from estimation.friction.model import LAWS
from estimation.online.belief.belief import ALPHA, COULOMB, MASS, RESIDUAL, VISCOUS
from estimation.online.solver.residual import follow_move
from stagedata import FrictionFigures
from tests.unit.estimation.online.solver.test_residual import Problem, at_truth, there_and_back

TS = 1e-3
GMS = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)


@pytest.fixture(params=list(LAWS))
def friction(request):
    """The figures of `GMS` that the law has."""
    if request.param == "gms":
        return GMS
    return replace(GMS, law=request.param, elements=0, stiffness=0.0, relaxation_rate=0.0)


@pytest.fixture
def made(friction):
    """A move there and back, at rest before with 0.5 N."""
    position = there_and_back()
    return Problem(position, np.zeros(len(position)), friction, rest=0.5)


@pytest.mark.parametrize("column", [COULOMB, VISCOUS, MASS, ALPHA])
def test_sensitivities_are_derivatives_of_the_force(made, column):
    above, below = at_truth(), at_truth()
    above[column] += 1e-6
    below[column] -= 1e-6
    numeric = (made.columns(above)[RESIDUAL] - made.columns(below)[RESIDUAL]) / 2e-6
    found = made.columns(at_truth())[column]
    np.testing.assert_allclose(found, numeric, atol=2e-3 * np.abs(found).max())


def test_the_state_at_the_end_is_that_of_the_last_sample(made, friction):
    p = at_truth()
    forces, slips = np.zeros(count_states(friction)), np.zeros(count_states(friction), bool)
    follow_move(p, made.axis, made.law, made.samples, made.rest, forces, slips)
    p[[VISCOUS, MASS]] = 0.0
    assert forces.sum() == pytest.approx(made.columns(p)[RESIDUAL, -1])
    assert not slips.any()  # it has turned and come to rest


@pytest.mark.parametrize("total", [-7.0, 0.0, 1.7])
def test_at_rest_the_state_adds_up_to_what_was_measured(friction, total):
    state = FrictionState.relaxed(count_states(friction))
    state.correct(total, friction)
    assert state.total == pytest.approx(total)


def test_at_rest_no_more_than_the_static_force_is_taken(friction):
    state = FrictionState.relaxed(count_states(friction))
    state.correct(100.0, friction)
    assert state.total == pytest.approx(6.0 * 1.4)


def test_far_above_the_stribeck_velocity_all_laws_have_the_coulomb_force(friction):
    speed = 0.1
    position = np.arange(1, 200) * TS * speed
    state = FrictionState.relaxed(count_states(friction))
    force, jacobian = follow(friction, state, position, np.full(199, speed), TS)
    assert force[-1] == pytest.approx(6.0, rel=1e-6)
    assert jacobian[-1, 0] == pytest.approx(1.0, rel=1e-6)
