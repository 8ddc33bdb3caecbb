"""Every friction law keeps the contract: sensitivities, mirror images, at-rest correction."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, count_states, follow, make_constants
from estimation.friction.model import LAWS
from estimation.online import EstimatorSettings
from estimation.online.belief.belief import ALPHA, COULOMB, KNOTS, LEVEL, MASS, RESIDUAL, VISCOUS
from estimation.online.solver.prepare import Sampled, prepare
from estimation.online.solver.residual import AtRest, fill_rows, follow_move, make_rows
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TS = 1e-3
GMS = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)


def with_law(law: str) -> FrictionFigures:
    """The figures of `GMS` that the law has."""
    if law == "gms":
        return GMS
    return replace(GMS, law=law, elements=0, stiffness=0.0, relaxation_rate=0.0)


@pytest.fixture(params=list(LAWS))
def friction(request) -> FrictionFigures:
    return with_law(request.param)


def there_and_back() -> np.ndarray:
    out = plan(0.0, 2e-3, Limits(0.5, 3.0, 200.0))
    back = plan(2e-3, 2e-3 - 1.3e-6, Limits(1e-3, 0.1, 20.0))
    first = out.sample(np.arange(0, int(out.duration / TS) + 2) * TS)[0]
    second = back.sample(np.arange(1, 40) * TS)[0]
    return np.concatenate([np.zeros(4), first, second])


class Pass:
    """One pass of a law over a move at rest before with 0.5 N."""

    def __init__(self, friction: FrictionFigures, position: np.ndarray) -> None:
        self.axis = EstimatorSettings(8.0, TS, 1e-9, 0.0115).axis(friction)
        self.law = make_constants(friction)
        self.rest = AtRest(np.zeros(count_states(friction)), friction.coulomb, 0.5)
        self.p = np.zeros(KNOTS)
        self.p[:LEVEL] = [1.0, 1.0, 1.0, 1.0, 1.0, friction.static_ratio, 0.0]
        valid, none = np.ones(len(position), bool), np.zeros(0, bool)
        sampled = Sampled(position, np.zeros(len(position)), valid, none, 0.0, 0.5)
        mean = np.append(self.p[:LEVEL], 0.0)
        self.samples = prepare(
            sampled, self.axis, self.law, friction.coulomb, mean, True, True
        ).samples

    def columns(self, p: np.ndarray) -> np.ndarray:
        rows = make_rows(0, 0, np.empty(0), len(self.samples.velocity))
        fill_rows(p, self.axis, self.law, self.samples, self.rest, 0, True, rows)
        return rows.columns


@pytest.mark.parametrize("column", [COULOMB, VISCOUS, MASS, ALPHA])
def test_sensitivities_are_derivatives_of_the_force(friction, column):
    made = Pass(friction, there_and_back())
    above, below = made.p.copy(), made.p.copy()
    above[column] += 1e-6
    below[column] -= 1e-6
    numeric = (made.columns(above)[RESIDUAL] - made.columns(below)[RESIDUAL]) / 2e-6
    found = made.columns(made.p)[column]
    np.testing.assert_allclose(found, numeric, atol=2e-3 * np.abs(found).max())


def test_the_state_at_the_end_is_that_of_the_last_sample(friction):
    made = Pass(friction, there_and_back())
    forces, slips = np.zeros(count_states(friction)), np.zeros(count_states(friction), bool)
    follow_move(made.p, made.axis, made.law, made.samples, made.rest, forces, slips)
    p = made.p.copy()
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
