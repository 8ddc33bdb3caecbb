"""Friction along sampled positions: blocks, rest, steps."""

import numpy as np
import pytest

from estimation.friction import FrictionState, follow
from estimation.friction.follow import REST_BAND
from estimation.trajectory import Limits, plan
from stagedata import FrictionFigures

TS = 1e-3
GMS = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
COULOMB = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, "coulomb")
MOVE = plan(0.0, 4e-3, Limits(0.1, 2.0, 100.0))
BACK = plan(4e-3, 3.98e-3, Limits(0.01, 0.2, 20.0))


def path():
    """There, a rest, and 20 um back: sliding, stopping, presliding."""
    there = MOVE.sample(np.arange(int(MOVE.duration / TS) + 20) * TS)
    back = BACK.sample(np.arange(int(BACK.duration / TS) + 20) * TS)
    return np.append(there[0], back[0]), np.append(there[1], back[1])


def test_the_state_goes_on_where_the_last_sample_was():
    position, velocity = path()
    whole, _ = follow(GMS, FrictionState.relaxed(10), position, velocity, TS)
    state = FrictionState.relaxed(10)
    half = len(position) // 2
    first, _ = follow(GMS, state, position[:half], velocity[:half], TS)
    assert state.memory[1] == pytest.approx(position[half - 1], abs=REST_BAND)
    second, _ = follow(GMS, state, position[half:], velocity[half:], TS)
    np.testing.assert_allclose(first, whole[:half])
    # the velocity before a block is not known: it differs by the step at the seam alone
    np.testing.assert_allclose(second[5:], whole[half + 5 :], atol=0.05)


def test_a_law_without_presliding_takes_one_step_a_sample():
    path = 1e-4 * np.sin(np.linspace(0.0, 3.0, 60))
    once, often = (
        follow(COULOMB, FrictionState.relaxed(1), path, np.gradient(path, TS), TS, steps)[0]
        for steps in (1, 4)
    )
    np.testing.assert_array_equal(often, once)
