"""The residual of a move: every derivative against finite differences, both directions, noise."""

import numpy as np
import pytest

from estimation.friction import FrictionState, count_states, follow, make_constants
from estimation.online.belief.belief import (
    FIGURES,
    KNOTS,
    LAG,
    LEVEL,
    ORIGIN,
    RESIDUAL,
    REST_FORCE,
    SLIP_FORCE,
    STATES,
    TURN_FORCE,
)
from estimation.online.settings import EstimatorSettings
from estimation.online.solver.prepare import Sampled, prepare
from estimation.online.solver.residual import AtRest, fill_rows, make_rows
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TS, MASS, NOISE = 1e-3, 8.0, 1e-9
TRUE = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)


def there_and_back(sign=1.0):
    """25 mm, a small overshoot and its return, rest: both zones and a turn."""
    out = plan(0.0, 2e-3, Limits(0.5, 3.0, 200.0))
    back = plan(2e-3, 2e-3 - 1.3e-6, Limits(1e-3, 0.1, 20.0))
    rest = np.zeros(4)
    first = out.sample(np.arange(0, int(out.duration / TS) + 2) * TS)[0]
    second = back.sample(np.arange(1, 40) * TS)[0]
    return sign * np.concatenate([rest, first, second])


class Problem:
    """What `fill_rows` takes, for one record of an axis at rest before with this force [N]."""

    def __init__(self, position, force, friction=TRUE, rest=0.0):
        sampled = Sampled(
            position, force, np.ones(len(position), bool), np.zeros(0, bool), 0.0, rest
        )
        mean = np.zeros(STATES)
        mean[:LEVEL] = at_truth()[:LEVEL]
        self.axis = EstimatorSettings(MASS, TS, NOISE, 0.0115).axis(friction)
        self.law = make_constants(friction)
        self.rest = AtRest(np.zeros(count_states(friction)), friction.coulomb, rest)
        self.samples = prepare(
            sampled, self.axis, self.law, friction.coulomb, mean, True, True
        ).samples
        self.spring = None

    def columns(self, p, knots=0):
        count = len(self.samples.velocity)
        rows = make_rows(knots, 0, np.arange(count) / (count - 1), count)
        fill_rows(p, self.axis, self.law, self.samples, self.rest, 0, True, rows)
        self.spring = rows.spring
        return rows.columns


def at_truth(knots=0):
    p = np.zeros(KNOTS + knots)
    p[:LEVEL] = [1.0, 1.0, 1.0, 1.0, 1.0, 0.4, 0.0]
    return p


@pytest.fixture(scope="module")
def problem():
    position = there_and_back()
    rng = np.random.default_rng(0)
    force = np.convolve(rng.normal(0, 0.1, len(position) + 20), np.ones(21) / 21, "valid")
    return Problem(position, force)


NAMES = {**dict(enumerate(FIGURES)), REST_FORCE: "rest", TURN_FORCE: "turn", SLIP_FORCE: "slip",
         ORIGIN: "origin", KNOTS: "first knot", KNOTS + 2: "last knot"}  # fmt: skip


@pytest.mark.parametrize("column", NAMES, ids=NAMES.values())
def test_every_derivative_is_that_of_the_residual(problem, column):
    p = at_truth(3)
    p[:LEVEL] = [1.03, 0.97, 1.02, 0.9, 1.01, 0.43, 0.2]
    if column >= LEVEL:  # products of the level and a figure's error are left out
        p[KNOTS:] = [0.01, -0.005, 0.02]
    step = 1e-6 if column < LEVEL else 1e-3
    above, below = p.copy(), p.copy()
    above[column] += step
    below[column] -= step
    derivative = problem.columns(p, 3)[column]
    numeric = (problem.columns(above, 3)[RESIDUAL] - problem.columns(below, 3)[RESIDUAL]) / (
        2 * step
    )
    scale = np.abs(derivative).max()
    assert scale > 0
    if column in (REST_FORCE, TURN_FORCE, SLIP_FORCE, ORIGIN):
        np.testing.assert_allclose(derivative, numeric, atol=1e-6 * scale)
    else:
        np.testing.assert_allclose(derivative, numeric, atol=2e-3 * scale)


def test_follows_the_finely_integrated_model():
    motion = plan(0.0, 2e-3, Limits(0.5, 3.0, 60.0))
    sub, count = 20, int(motion.duration / TS) + 3
    x, v, a = motion.sample(np.arange(-4 * sub, count * sub + 1) * TS / sub)
    friction, _ = follow(TRUE, FrictionState.relaxed(4), x, v, TS / sub, 1, 0.0)
    force = MASS * a + TRUE.viscous * v + friction
    residual = Problem(x[::sub].copy(), force[::sub].copy()).columns(at_truth())[RESIDUAL]
    # The jerk's corners fall between samples.
    assert np.abs(residual).max() < 8.0 * 60.0 * TS / 5.0
    assert np.median(np.abs(residual)) < 0.005


def test_a_lag_is_seen_as_a_lag():
    motion = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))
    t = np.arange(-4, int(motion.duration / TS) + 2) * TS
    x = motion.sample(t)[0]
    smooth = 8.0 * np.sin(40 * t)  # any force will do
    later = 8.0 * np.sin(40 * (t - 0.4 * TS))
    p = at_truth()
    straight = Problem(x, smooth).columns(p)[RESIDUAL]
    p[LAG] = 0.4
    np.testing.assert_allclose(Problem(x, later).columns(p)[RESIDUAL], straight, atol=1e-4)


def test_encoder_noise_at_rest_and_in_stick_is_a_spring():
    # No dead band, nothing rectified: the force follows every nanometre and comes back.
    position = there_and_back()
    noisy = position + np.random.default_rng(2).normal(0.0, NOISE, len(position))
    force = np.zeros(len(position))
    clean = Problem(position, force)
    p = at_truth()
    p[4] = 0.0  # no mass: the second difference is another matter
    quiet = clean.columns(p)[RESIDUAL]
    problem = Problem(noisy, force)
    loud = problem.columns(p)[RESIDUAL]
    assert problem.spring[0] == pytest.approx(6e5)
    rest = slice(-15, None)
    assert np.std(loud[rest] - quiet[rest]) < 2.0 * 6e5 * NOISE
    assert abs(np.mean(loud[rest] - quiet[rest])) < 40.0 * 6e5 * NOISE
