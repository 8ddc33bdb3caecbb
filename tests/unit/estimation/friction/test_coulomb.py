"""The law without presliding: force and derivatives along a path, and an estimator that uses it."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, follow
from estimation.noise import quantisation
from estimation.online import EstimatorSettings, SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures
from tests.unit.estimation.online.moves import modelled_force, whole

TRUE = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, law="coulomb")
MASS, TS = 8.0, 1e-3
STATIC = 8.4
STEP = 0.04
GMS = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SETTINGS = EstimatorSettings(MASS, TS, 1e-9, quantisation(STEP))


def path(target, start=0.0):
    """Position, velocity and acceleration on the way and at rest behind it."""
    motion = plan(start, target, Limits(0.3, 3.0, 200.0))
    return motion.sample(np.arange(round(motion.duration / TS) + 40) * TS)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_force_follows_the_speed(sign):
    x, v, _ = path(sign * 0.02)
    force, _ = follow(TRUE, FrictionState.relaxed(1), x, v, TS)
    fast = np.abs(v) > 0.02
    assert force[fast] == pytest.approx(sign * 6.0, rel=1e-3)
    assert np.abs(force).max() <= STATIC + 1e-9
    assert force[-1] == pytest.approx(sign * STATIC, rel=0.02)  # it stuck where it stopped


def test_figures_learned_under_another_law_are_taken_as_far_as_the_law_has_them():
    settings = EstimatorSettings(MASS, TS, 1e-9, 0.01)
    estimator = SplitHorizonEstimator(TRUE, settings)
    estimator.believe({"coulomb": (7.0, 0.1), "stiffness": (6e5, 1e3)})
    assert estimator.friction == replace(TRUE, coulomb=7.0)


def move(truth, seed, start=0.0):
    """25 mm of a stage with this friction, from no friction force at rest."""
    rng = np.random.default_rng(seed)
    motion = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))
    x = start + motion.sample((np.arange(-5, 250) + rng.uniform()) * TS)[0]
    force = np.round(modelled_force(truth, MASS, x) / STEP) * STEP
    x = x + rng.normal(0.0, 1e-9, len(x))
    return whole(x, force, 1.0 + seed, float(force[:4].mean()))


def learned(truth, moves=3):
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), SETTINGS)
    for seed in range(moves):
        data = move(truth, seed)
        estimator.at_rest(float(data.position[0]), data.rest_force, data.time - 0.1)
        estimate = estimator.update(data)
        assert estimate.accepted, estimate.reason
    return estimator


@pytest.mark.parametrize("truth", [TRUE, GMS], ids=["its own truth", "a gms truth"])
def test_from_half_the_friction_it_finds_coulomb_and_viscous_force(truth):
    estimator = learned(truth)
    found, sigma = estimator.friction, estimator.sigma
    assert found.law == "coulomb"
    assert set(sigma) == {"coulomb", "viscous"}
    assert found.coulomb == pytest.approx(6.0, rel=0.01)
    assert found.viscous == pytest.approx(20.0, rel=0.02)
    assert abs(found.coulomb - 6.0) < 3.0 * sigma["coulomb"]
