"""Mean forces around the samples: what goes with the second difference of the positions."""

import numpy as np
import pytest

from estimation.friction import FrictionState, follow
from estimation.move import MoveData
from estimation.sampled_force import kink_share, modelled_friction, with_mean_force
from stagedata import FrictionFigures

TS, MASS, FINE = 1e-3, 8.0, 200


def sampled(force_at):
    """A mass under a force over time, integrated finely; samples every TS."""
    at = (np.arange(60 * FINE) + 0.5) * TS / FINE
    velocity = np.concatenate([[0.0], np.cumsum(force_at(at)) * TS / FINE / MASS])
    # the trapezium is exact for what is constant within a step
    position = np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2 * TS / FINE)])
    time = TS * np.arange(60)
    return MoveData(
        position[::FINE][:60], force_at(time), np.ones(60, dtype=bool), 0.0, 0.0
    )  # fmt: skip


def residual(move):
    acceleration = np.diff(move.position, 2) / TS**2
    return move.force[1:-1] - MASS * acceleration


@pytest.mark.parametrize("tip", [0.0, 5e-5])
def test_an_interpolated_force_is_level_with_the_acceleration(tip):
    knots = np.random.default_rng(1).normal(0.0, 10.0, 62)
    move = sampled(lambda t: np.interp(t, TS * np.arange(-1, 61) + tip, knots))
    share = kink_share(TS, tip)
    after = with_mean_force(move, share, None, np.inf)
    plain, mean = residual(move), residual(after)
    assert np.sqrt(np.mean(mean**2)) < (0.002 if tip == 0.0 else 0.1) * np.sqrt(np.mean(plain**2))


def test_friction_is_taken_for_smooth():
    model = FrictionFigures(4, 6.0, 0.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
    time = TS * np.arange(60)
    position = 2e-6 * (1.0 - np.cos(2.0 * np.pi * time / 0.03))  # a spring, hardly slipping
    path = np.gradient(position, TS)
    friction, _ = follow(model, FrictionState.relaxed(4, 0.0), position, path, TS)
    move = MoveData(position, friction, np.ones(60, dtype=bool), 0.0, 0.0)
    state = FrictionState.relaxed(4, 0.0)
    modelled = modelled_friction(move, model, state, TS)
    after = with_mean_force(move, 1.0 / 6.0, modelled, np.inf)
    bend = np.diff(friction, 2)
    np.testing.assert_allclose(after.force[1:-1], friction[1:-1] + bend / 12.0, atol=1e-9)
    assert not state.slipping.any()  # the state is as it was
    assert state.total == 0.0


def test_what_has_no_neighbours_stays_as_sampled():
    move = sampled(lambda t: 10.0 * np.sin(300.0 * t))
    move.valid[10] = False
    move.force[20] = 120.0
    disturbed = np.zeros(60, dtype=bool)
    disturbed[30] = True
    move = MoveData(move.position, move.force, move.valid, 0.0, 0.0, disturbed)
    after = with_mean_force(move, 1.0 / 6.0, None, 120.0)
    same = np.flatnonzero(after.force == move.force)
    assert set(same) == {0, 9, 10, 11, 19, 20, 21, 29, 30, 31, 59}


def test_commanded_and_feedback_force_each_get_their_own_mean():
    """Half of the force is interpolated, the other half smooth: each gets its own mean."""
    knots = np.random.default_rng(2).normal(0.0, 10.0, 62)
    at = TS * np.arange(-1, 61)

    def smooth(time):
        return 10.0 * np.sin(500.0 * time)

    def commanded(time):
        return np.interp(time, at, knots)

    move = sampled(lambda t: smooth(t) + commanded(t))
    offset = commanded(TS * np.arange(60))
    separate = with_mean_force(move, kink_share(TS, 0.0), None, np.inf, offset)
    together = with_mean_force(move, kink_share(TS, 0.0), None, np.inf)
    off, other = np.std(residual(separate)), np.std(residual(together))
    assert off < 0.1 * other
