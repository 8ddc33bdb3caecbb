"""A Coulomb-Stribeck host: its own truth is found, and a stage with presliding is approximated."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, count_states, follow
from estimation.move import MoveData
from estimation.noise import quantisation
from estimation.online import EstimatorSettings, SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TS, MASS, STEP = 1e-3, 8.0, 0.04
GMS = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = replace(GMS, law="coulomb", elements=0, stiffness=0.0, relaxation_rate=0.0)
SETTINGS = EstimatorSettings(MASS, TS, 1e-9, quantisation(STEP))


def move(truth: FrictionFigures, seed: int, start: float = 0.0) -> MoveData:
    """25 mm of a stage with this friction, from no friction force at rest."""
    rng = np.random.default_rng(seed)
    motion = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))
    x = start + motion.sample((np.arange(-5, 250) + rng.uniform()) * TS)[0]
    v, a = (x[2:] - x[:-2]) / (2 * TS), np.diff(x, 2) / TS**2
    state = FrictionState.relaxed(count_states(truth), float(x[0]))
    inner = follow(truth, state, x[1:-1], v, TS, band=0.0)[0] + truth.viscous * v + MASS * a
    force = np.round(np.concatenate([inner[:1], inner, inner[-1:]]) / STEP) * STEP
    x = x + rng.normal(0.0, 1e-9, len(x))
    return MoveData(x, force, np.ones(len(x), bool), 1.0 + seed, float(force[:4].mean()))


def learn(truth: FrictionFigures, moves: int = 3) -> SplitHorizonEstimator:
    estimator = SplitHorizonEstimator(COULOMB.scaled(0.5), SETTINGS)
    for seed in range(moves):
        data = move(truth, seed)
        estimator.at_rest(float(data.position[0]), data.rest_force, data.time - 0.1)
        estimate = estimator.update(data)
        assert estimate.accepted, estimate.reason
    return estimator


@pytest.mark.parametrize("truth", [COULOMB, GMS], ids=["its own truth", "a gms truth"])
def test_from_half_the_friction_it_finds_coulomb_and_viscous_force(truth):
    estimator = learn(truth)
    found, sigma = estimator.friction, estimator.sigma
    assert found.law == "coulomb"
    assert found.coulomb == pytest.approx(6.0, rel=0.01)
    assert found.viscous == pytest.approx(20.0, rel=0.02)
    assert abs(found.coulomb - 6.0) < 3.0 * sigma["coulomb"]


def test_what_the_law_does_not_have_is_left_alone():
    estimator = learn(COULOMB, 1)
    start = COULOMB.scaled(0.5)
    assert estimator.friction.stiffness == start.stiffness
    assert estimator.friction.relaxation_rate == start.relaxation_rate


def test_at_rest_the_friction_is_what_was_measured():
    estimator = learn(COULOMB, 1)
    assert estimator.at_rest(0.0, 2.5, 3.0).total == pytest.approx(2.5)
