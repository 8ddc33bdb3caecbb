"""A soft contact and a force in steps of 0.05 N: zone A is found, the stiffness stays sensible."""

import numpy as np
import pytest

from estimation.friction import breakaway_travel
from estimation.noise import quantisation
from estimation.online.belief.belief import BeliefSettings
from estimation.online.estimator import EstimatorSettings, SplitHorizonEstimator
from estimation.online.solver.zones import SLIDE, split
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures
from tests.unit.estimation.online.moves import modelled_force, whole

TS, STEP = 1e-3, 0.05
PRIOR, PRIOR_SIGMA = 900.0, 100.0
TRUE = FrictionFigures(4, 2.0, 1.0, 1000.0, 2.0, 0.5, 1e-3, 1.0)
SPREAD = (0.3, 0.5, PRIOR_SIGMA / PRIOR, 0.2, 0.05, 0.3, 0.5)
SETTINGS = EstimatorSettings(
    1.0, TS, 1e-9, quantisation(STEP), model_error=0.0,
    belief=BeliefSettings(start_spread=SPREAD, wander=0.0),
)  # fmt: skip


def move(seed):
    """25 mm that overshoot by 0.2 um."""
    generator = np.random.default_rng(seed)
    time = (np.arange(-5, 330) + generator.uniform()) * TS
    motion = plan(0.0, 25e-3, Limits(0.5, 3.0, 200.0))
    x = motion.sample(time)[0]
    behind = np.clip(time - motion.duration, 0.0, None)
    x = x + 0.3e-6 * np.exp(-behind / 15e-3) * np.sin(2 * np.pi * behind / 40e-3)
    force = np.round(modelled_force(TRUE, 1.0, x) / STEP) * STEP
    noise = generator.normal(0.0, 1e-9, len(x))
    return whole(x + noise, force, rest_force=float(force[:4].mean()))


@pytest.mark.parametrize("seed", range(3))
def test_what_a_first_move_does_not_tell_stays_at_its_prior(seed):
    prior = FrictionFigures(4, 2.0, 1.0, PRIOR, 2.0, 0.5, 1e-3, 1.0)
    estimator = SplitHorizonEstimator(prior, SETTINGS)
    estimator.at_rest(0.0, 0.0, 0.0)
    first = estimator.update(move(seed))
    assert first.accepted
    assert "A" in first.zones
    assert first.friction.coulomb == pytest.approx(2.0, rel=0.02)
    assert abs(first.friction.stiffness - PRIOR) <= 2.0 * PRIOR_SIGMA
    assert first.sigma["stiffness"] == pytest.approx(PRIOR_SIGMA, rel=0.1)


def test_zone_a_of_a_soft_contact_begins_behind_the_breakaway():
    data = move(0)
    slide = np.flatnonzero(split(data.position, TRUE, TS) == SLIDE)
    assert len(slide) > 80
    assert data.position[slide[0]] > breakaway_travel(TRUE)
