"""A rounded force that changes evenly: its samples have one error between them, and say so."""

import numpy as np
import pytest

from estimation.friction import FrictionState
from estimation.noise import quantisation
from estimation.online.belief.belief import BeliefSettings
from estimation.online.estimator import EstimatorSettings, SplitHorizonEstimator
from estimation.online.solver.shared_rounding import share_rounding
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures
from tests.unit.estimation.online.moves import modelled_force, whole

TS, STEP, MASS, COUNT = 1e-3, 0.04, 8.0, 200
TIME = np.arange(COUNT + 2)
OTHERS = (6e5, 100.0, 0.4, 2e-3, 1.0)


def grown(force, jitter=0.0, use=None):
    """By how much the variance of the rows grows, in step^2, for a model that has it right."""
    codes = np.round(force / STEP) * STEP
    variance = np.zeros(len(force) - 2)
    use = np.ones(len(variance), np.int8) if use is None else use
    share_rounding(codes, (force - codes)[1:-1], use, STEP, jitter, variance)
    return variance / STEP**2


def variance_of_mean(shared):
    """Variance of the mean force over all rows, in step^2."""
    return 1.0 / (1.0 / (1.0 / 12.0 + shared)).sum()


@pytest.mark.parametrize("slope", [0.0, 1.0, -3.0])
def test_codes_that_come_evenly_are_one_measurement(slope):
    assert variance_of_mean(grown(0.123 + slope * STEP * TIME)) == pytest.approx(1.0 / 12.0)


def test_a_slope_that_the_positions_noise_hides_may_be_none():
    slow = (0.4 * TIME / TIME[-1] - 0.2) * STEP
    assert variance_of_mean(grown(slow)) == pytest.approx(0.6**2 / 12.0, rel=0.02)
    assert variance_of_mean(grown(slow, jitter=10.0 * STEP)) == pytest.approx(1.0 / 12.0)


@pytest.mark.parametrize("slope", [2.0**0.5, 0.05, 0.3 * 3.0**0.5])
def test_a_force_that_runs_through_its_codes_shares_nothing(slope):
    assert variance_of_mean(grown(slope * STEP * TIME)) < 1.2 / 12.0 / COUNT


def test_a_curve_shares_nothing():
    assert variance_of_mean(grown(0.01 * STEP * TIME**2)) < 1.5 / 12.0 / COUNT


def test_jitter_of_codes_takes_most_of_the_sharing_away():
    force = 0.123 + np.random.default_rng(1).normal(0.0, 0.5 * STEP, len(TIME))
    assert variance_of_mean(grown(force)) < 1.5 / 12.0 / COUNT


def test_on_the_border_of_two_codes_the_error_is_half_a_code_less_their_share():
    force = np.full(len(TIME), 0.5 * STEP - 1e-6)
    force[1::10] += 2e-6
    assert variance_of_mean(grown(force)) == pytest.approx(0.4**2, rel=1e-3)


def test_what_is_left_out_does_not_count():
    use = np.ones(COUNT, np.int8)
    use[40:60] = 0
    shared = grown(np.full(len(TIME), 0.123), use=use)
    assert variance_of_mean(shared[use > 0]) == pytest.approx(1.0 / 12.0)


@pytest.mark.parametrize("step", [STEP, 1e-3])
def test_sigma_at_constant_speed_covers_a_force_in_steps(step):
    """Taken for white noise, the steps made sigma 2 (Fc) and 4 to 6 times (sigma_v) too small."""
    settings = EstimatorSettings(
        MASS, TS, 1e-9, quantisation(step), model_error=0.0, belief=BeliefSettings(wander=0.0),
        fixed=("relaxation_rate",),
    )  # fmt: skip
    scores = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        true = FrictionFigures(
            4, 6.0 * rng.uniform(0.8, 1.2), 20.0 * rng.uniform(0.8, 1.2), *OTHERS
        )
        motion = plan(0.0, 15e-3 * rng.uniform(0.9, 1.1), Limits(0.1, 2.0, 130.0))
        x = motion.sample((np.arange(-5, int(motion.duration / TS) + 70) + rng.uniform()) * TS)[0]
        force = modelled_force(true, MASS, x)
        shift = rng.uniform(0.0, step)
        force = np.round((force + shift) / step) * step - shift
        estimator = SplitHorizonEstimator(
            FrictionFigures(4, 3.0, 10.0, *OTHERS), settings, state=FrictionState.relaxed(4)
        )
        seen = x + rng.normal(0.0, 1e-9, len(x))
        estimate = estimator.update(whole(seen, force, rest_force=float(force[:4].mean())))
        assert estimate.accepted
        found, sigma = estimate.friction, estimate.sigma
        scores.append(
            [
                (found.coulomb - true.coulomb) / sigma["coulomb"],
                (found.viscous - true.viscous) / sigma["viscous"],
            ]
        )
    assert (np.sqrt(np.mean(np.square(scores), axis=0)) < 2.0).all()
