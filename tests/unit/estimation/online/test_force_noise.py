"""Sigma of the stiffness where force sensor and encoder are about equally good."""

import numpy as np
import pytest

from estimation.friction import FrictionState
from estimation.online.belief.belief import BeliefSettings
from estimation.online.estimator import EstimatorSettings, SplitHorizonEstimator
from stagedata import FrictionFigures
from tests.unit.estimation.online.moves import modelled_force, whole

TS, ENCODER, MASS, REST = 1e-3, 1e-9, 8.0, 5
TRUE = FrictionFigures(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SPRING = TRUE.stiffness * ENCODER
"""What the encoder's noise does to a spring [N]."""


def motion(length=25e-3):
    """Sine acceleration of 3 m/s^2 peak, out of rest and to rest; rows of samples [m]."""
    total = np.sqrt(2.0 * np.pi * length / 3.0)
    turn = np.clip(np.arange(-REST, 290) * TS + 3e-4, 0.0, total) / total
    return length * (turn - np.sin(2.0 * np.pi * turn) / (2.0 * np.pi))


@pytest.fixture(scope="module")
def exact():
    """Positions and the force that goes with them."""
    x = motion()
    return x, modelled_force(TRUE, MASS, x)


def stiffness(exact, noise, runs):
    """Errors of sigma0, relative, and what was said of them (median)."""
    position, force = exact
    settings = EstimatorSettings(
        MASS, TS, ENCODER, noise, model_error=0.0, belief=BeliefSettings(wander=0.0),
        fixed=("relaxation_rate",),
    )  # fmt: skip
    errors, sigmas = np.empty(runs), np.empty(runs)
    for run in range(runs):
        rng = np.random.default_rng(run)
        seen = force + noise * rng.normal(size=len(force))
        estimator = SplitHorizonEstimator(
            TRUE.scaled(0.5), settings, state=FrictionState.relaxed(4)
        )
        moved = position + ENCODER * rng.normal(size=len(position))
        rest = float(seen[: REST - 1].mean())
        estimate = estimator.update(whole(moved, seen, rest_force=rest))
        assert estimate.accepted, estimate.reason
        errors[run] = estimate.friction.stiffness / TRUE.stiffness - 1.0
        sigmas[run] = estimate.sigma["stiffness"] / TRUE.stiffness
    return errors, float(np.median(sigmas))


def test_a_force_half_as_noisy_again_does_not_lose_where_the_motion_began(exact):
    """The samples at rest show it until the force is far noisier than the encoder."""
    (fine, fine_sigma), (coarse, coarse_sigma) = (
        stiffness(exact, share * SPRING, 60) for share in (0.4, 0.6)
    )
    assert np.std(coarse) < 1.45 * np.std(fine)
    assert coarse_sigma < 1.45 * fine_sigma
    # and sigma is what the errors are
    assert np.mean(np.abs(coarse) < 1.96 * coarse_sigma) >= 0.88
