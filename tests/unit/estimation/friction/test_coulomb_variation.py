"""Friction on a way over which the Coulomb force differs."""

import numpy as np
import pytest

from estimation.friction import (
    FrictionState,
    follow,
    friction_feedforward,
    level_with_target,
    state_after,
)
from estimation.move import MoveData
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

FRICTION = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
TS = 1e-3
MOTION = plan(0.0, 0.025, Limits(0.5, 3.0, 200.0))
SAMPLES = round(MOTION.duration / TS) + 30
TIME = np.arange(1, SAMPLES + 1) * TS
POSITION, VELOCITY, _ = MOTION.sample(TIME)


def along(state, variation, position=POSITION, velocity=VELOCITY):
    return follow(FRICTION, state, position, velocity, TS, variation=variation)[0]


def test_without_variation_it_is_the_plain_model():
    state, flat = FrictionState.relaxed(10), np.zeros(SAMPLES)
    demand = FRICTION, state, MOTION, SAMPLES, TS, 1e-4
    for sent in (0, 40):
        np.testing.assert_array_equal(
            friction_feedforward(*demand, sent, flat), friction_feedforward(*demand, sent)
        )


def test_sliding_follows_the_place_and_sticking_does_not():
    variation = 0.2 * (1.0 - POSITION / 0.025)  # 7.2 N where it begins, 6 N at the target
    state = FrictionState.relaxed(10)
    force = along(state, variation)
    sliding = VELOCITY > 0.05
    assert force[sliding] == pytest.approx(6.0 * (1 + variation[sliding]), rel=0.03)
    # At rest nothing slips: whatever Fc does, the elements keep their force.
    rest = state.forces.copy()
    still = np.full(50, POSITION[-1])
    along(state, np.linspace(0, -0.5, 50), still, np.zeros(50))
    assert state.forces == pytest.approx(rest)


def test_data_made_level_are_those_of_a_flat_table():
    variation = 0.15 * np.cos(40 * POSITION) - 0.15 * np.cos(40 * 0.025)
    real = FrictionState.relaxed(10)
    scaled = real.copy()
    force = along(real.copy(), variation)
    valid = np.ones(SAMPLES, dtype=np.bool_)
    valid[40] = False
    move = MoveData(POSITION.copy(), force, valid, 0.0, 0.0)
    move.position[40] = 0.0  # a hole is bridged, not believed
    flat = level_with_target(FRICTION, real, scaled, variation, move, TS)
    expected, _ = follow(FRICTION, FrictionState.relaxed(10), POSITION, VELOCITY, TS)
    assert np.abs(flat.force - expected)[valid].max() < 0.05
    assert np.abs(force - expected).max() > 0.3
    assert real.total == 0.0  # the states given are not touched
    end = state_after(FRICTION, real, variation, move, TS)
    assert end.total == pytest.approx(force[-1], abs=0.05)
