"""The law without presliding: force and derivatives along a path, and an estimator that uses it."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.friction import FrictionState, breakaway_travel, count_states, follow
from estimation.move import MoveData
from estimation.noise import encoder_noise, quantisation
from estimation.online import EstimatorSettings, SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TRUE = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, law="coulomb")
MASS, TS = 8.0, 1e-3
STATIC = 8.4
STEP = 0.04
GMS = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SETTINGS = EstimatorSettings(MASS, TS, 1e-9, quantisation(STEP))


def path(target: float, start: float = 0.0):
    """Position, velocity and acceleration on the way and at rest behind it."""
    motion = plan(start, target, Limits(0.3, 3.0, 200.0))
    return motion.sample(np.arange(round(motion.duration / TS) + 40) * TS)


def answer(friction: FrictionFigures, state: FrictionState, target: float, start: float, seed: int):
    """Position and force as sampled, with the force at rest before."""
    x, v, a = path(target, start)
    rest = state.total
    state.settle_at(start)
    force, _ = follow(friction, state, x, v, TS)
    rng = np.random.default_rng(seed)
    measured = force + friction.viscous * v + MASS * a + rng.normal(0.0, 0.01, len(x))
    return x + rng.normal(0.0, 1e-9, len(x)), measured, rest


def test_it_has_one_force_and_no_presliding():
    assert count_states(TRUE) == 1
    assert breakaway_travel(TRUE) == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_force_follows_the_speed(sign):
    x, v, _ = path(sign * 0.02)
    force, _ = follow(TRUE, FrictionState.relaxed(1), x, v, TS)
    fast = np.abs(v) > 0.02
    assert force[fast] == pytest.approx(sign * 6.0, rel=1e-3)
    assert np.abs(force).max() <= STATIC + 1e-9
    assert force[-1] == pytest.approx(sign * STATIC, rel=0.02)  # it stuck where it stopped


def test_the_derivative_by_the_coulomb_force_is_that_of_the_force():
    x, v, _ = path(0.02)
    force, jacobian = follow(TRUE, FrictionState.relaxed(1), x, v, TS)
    more, _ = follow(replace(TRUE, coulomb=6.01), FrictionState.relaxed(1), x, v, TS)
    assert jacobian[:, 0] == pytest.approx((more - force) / 0.01, abs=1e-6)
    assert np.abs(jacobian[:, 1:]).max() == 0.0


def test_at_rest_the_force_is_what_was_measured_up_to_the_static_limit():
    state = FrictionState.relaxed(1)
    state.correct(-7.0, TRUE)
    assert state.total == -7.0
    state.correct(12.0, TRUE)
    assert state.total == pytest.approx(STATIC)


def test_an_estimator_learns_the_figures_that_the_law_has():
    settings = EstimatorSettings(
        mass=MASS, period=TS, position_noise=encoder_noise(1e-9, 1e-9), force_noise=0.01
    )
    estimator = SplitHorizonEstimator(TRUE.scaled(0.5), settings)
    state, time, at = FrictionState.relaxed(1), 0.0, 0.0
    for seed, target in enumerate((0.02, -0.01, 0.015, 0.0)):
        x, force, rest = answer(TRUE, state, target, at, seed)
        estimator.at_rest(at, rest, time)
        estimate = estimator.update(MoveData(x, force, np.ones(len(x), bool), time, rest))
        assert estimate.accepted, estimate.reason
        time, at = time + len(x) * TS, target
    assert set(estimator.sigma) == {"coulomb", "viscous"}
    assert estimate.covariance.shape == (2, 2)
    for name in ("coulomb", "viscous"):
        error = abs(getattr(estimator.friction, name) - getattr(TRUE, name))
        assert error < 4.0 * estimator.sigma[name]
        assert estimator.sigma[name] < 0.05 * getattr(TRUE, name)


def test_figures_learned_under_another_law_are_taken_as_far_as_the_law_has_them():
    settings = EstimatorSettings(MASS, TS, 1e-9, 0.01)
    estimator = SplitHorizonEstimator(TRUE, settings)
    estimator.believe({"coulomb": (7.0, 0.1), "stiffness": (6e5, 1e3)})
    assert estimator.friction == replace(TRUE, coulomb=7.0)


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


def learned(truth: FrictionFigures, moves: int = 3) -> SplitHorizonEstimator:
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
    assert found.coulomb == pytest.approx(6.0, rel=0.01)
    assert found.viscous == pytest.approx(20.0, rel=0.02)
    assert abs(found.coulomb - 6.0) < 3.0 * sigma["coulomb"]
