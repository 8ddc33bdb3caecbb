"""A rounded force that hardly changes: its samples have one error between them, and say so."""

import numpy as np
import pytest

from estimation.belief import BeliefSettings
from estimation.gms import Friction, FrictionState, follow
from estimation.noise import quantisation
from estimation.shared_rounding import share_rounding
from estimation.split_horizon import EstimatorSettings, MoveData, SplitHorizonEstimator
from estimation.trajectory import Limits, plan

TS, STEP, MASS, COUNT = 1e-3, 0.04, 8.0, 200
OTHERS = (6e5, 100.0, 0.4, 2e-3, 1.0)


def grown(force, jitter=0.0, use=None):
    """By how much the variance of the rows grows, in step^2, for a model that has it right."""
    codes = np.round(force / STEP) * STEP
    variance = np.zeros(len(force) - 2)
    use = np.ones(len(variance), np.int8) if use is None else use
    share_rounding(codes, (force - codes)[1:-1], use, STEP, jitter, variance)
    return variance / STEP**2


def test_equal_codes_are_one_measurement():
    shared = grown(np.full(COUNT + 2, 0.123))
    assert shared == pytest.approx(COUNT / 12.0)
    assert 1.0 / (1.0 / shared).sum() == pytest.approx(1.0 / 12.0)


def test_a_force_that_runs_through_its_codes_shares_nothing():
    time = np.arange(COUNT + 2)
    assert (grown(0.9 * STEP * time) == 0.0).all()
    slow = grown(0.05 * STEP * time)[20:-40]
    assert slow.max() < 20.0 / 12.0 / 10.0  # twenty samples a code


def test_jitter_of_a_code_takes_the_sharing_away():
    rng = np.random.default_rng(1)
    shared = grown(0.123 + rng.normal(0.0, 0.5 * STEP, COUNT + 2))
    assert (1.0 / (1.0 / 12.0 + shared)).mean() > 0.75 * 12.0


def test_on_the_border_of_two_codes_the_error_is_half_a_code_less_their_share():
    force = np.full(COUNT + 2, 0.5 * STEP - 1e-6)
    force[1::10] += 2e-6
    assert grown(force) == pytest.approx(COUNT * 0.4**2)


def test_what_is_left_out_does_not_count():
    use = np.ones(COUNT, np.int8)
    use[40:60] = 0
    assert grown(np.full(COUNT + 2, 0.123), use=use) == pytest.approx(180.0 / 12.0)


@pytest.mark.parametrize("step", [STEP, 1e-3])
def test_sigma_at_constant_speed_covers_a_force_in_steps(step):
    """Taken for white noise, the steps made sigma 2 (Fc) and 6 times (sigma_v) too small."""
    settings = EstimatorSettings(
        MASS, TS, 1e-9, quantisation(step), model_error=0.0, belief=BeliefSettings(wander=0.0),
        fixed=("relaxation_rate",),
    )  # fmt: skip
    scores = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        true = Friction(4, 6.0 * rng.uniform(0.8, 1.2), 20.0 * rng.uniform(0.8, 1.2), *OTHERS)
        motion = plan(0.0, 15e-3 * rng.uniform(0.9, 1.1), Limits(0.1, 2.0, 130.0))
        x = motion.sample((np.arange(-5, int(motion.duration / TS) + 70) + rng.uniform()) * TS)[0]
        v, a = (x[2:] - x[:-2]) / (2 * TS), np.diff(x, 2) / TS**2
        elements = follow(true, FrictionState.relaxed(4), x[1:-1], v, TS, band=0.0)[0]
        inner = elements + true.viscous * v + MASS * a
        force = np.concatenate([inner[:1], inner, inner[-1:]])
        shift = rng.uniform(0.0, step)
        force = np.round((force + shift) / step) * step - shift
        estimator = SplitHorizonEstimator(
            Friction(4, 3.0, 10.0, *OTHERS), settings, state=FrictionState.relaxed(4)
        )
        estimate = estimator.update(
            MoveData(
                x + rng.normal(0.0, 1e-9, len(x)), force, np.ones(len(x), bool), 1.0,
                float(force[:4].mean()),
            )
        )  # fmt: skip
        assert estimate.accepted
        found, sigma = estimate.friction, estimate.sigma
        scores.append(
            [
                (found.coulomb - true.coulomb) / sigma["coulomb"],
                (found.viscous - true.viscous) / sigma["viscous"],
            ]
        )
    assert (np.sqrt(np.mean(np.square(scores), axis=0)) < 1.5).all()
