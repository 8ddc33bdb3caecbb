"""Friction at low speed, learned where long moves come to rest."""

import numpy as np
import pytest

from estimation.low_speed_friction import LowSpeedFriction
from estimation.move import MoveData
from estimation.trajectory import Limits, plan

PERIOD, MASS, COULOMB, VISCOUS = 1e-3, 8.0, 6.0, 12.0
LIMITS = Limits(velocity=0.3, acceleration=3.0, jerk=60.0)


def decelerate(number, level=0.0, speed=12e-3, to=0.05):
    """Position, force and model's friction of a long move.

    Besides acts a force of this level [N] that dies out with this speed [m/s].
    """
    motion = plan(0.0, to, LIMITS)
    time = np.arange(round(motion.duration / PERIOD) + 30) * PERIOD
    position, velocity, acceleration = motion.sample(time)
    friction = COULOMB * np.sign(velocity)
    noise = np.random.default_rng(number)
    extra = extra_force(level, speed, velocity)
    force = MASS * acceleration + friction + VISCOUS * velocity + extra
    return (
        position + noise.normal(0.0, 1e-9, len(time)),
        force + noise.normal(0.0, 0.01, len(time)),
        friction,
    )


def extra_force(level, speed, velocity):
    share = velocity / speed
    return level * np.tanh(5.0 * share) * np.exp(-np.abs(share))


@pytest.mark.parametrize("level", [3.0, -2.0])
@pytest.mark.parametrize("speed", [7e-3, 12e-3, 28e-3])
@pytest.mark.parametrize("to", [0.05, -0.05])
def test_level_and_speed_are_found(level, speed, to):
    found = LowSpeedFriction(COULOMB, PERIOD)
    changes = 0
    for number in range(4):
        changes += found.learn(*decelerate(number, level, speed, to * (-1) ** number), COULOMB)
        assert not (number == 0 and found.level)
    assert found.level
    assert changes == 1
    slow = np.linspace(-0.05, 0.05, 101)
    off = np.abs(found.force(slow) - extra_force(level, speed, slow)).max()
    assert off < 0.15 * abs(level)
    assert len(found.describe()) == 1


def test_it_is_taken_off_a_move_that_has_lost_samples():
    """Of those that are there as if none were lost; from lost ones nothing is learned."""
    found = LowSpeedFriction(COULOMB, PERIOD)
    for number, to in enumerate((0.05, 0.05, 0.1)):
        position, force, friction = decelerate(number, 3.0, to=to)
        found.learn(position, force, friction, COULOMB)
    valid = np.ones(len(position), dtype=np.bool_)
    whole = found.without(MoveData(position, force, valid, 0.0, 0.0))
    assert np.abs(whole.force - force).max() > 1.0
    valid[50:52] = False
    lossy = np.where(valid, position, 0.0)
    rest = found.without(MoveData(lossy, force, valid, 0.0, 0.0))
    np.testing.assert_allclose(rest.force[valid], whole.force[valid], atol=0.2)


def test_the_right_model_leaves_nothing():
    found = LowSpeedFriction(COULOMB, PERIOD)
    for number in range(5):
        assert not found.learn(*decelerate(number), COULOMB)
    assert found.level == 0.0
    assert found.describe() == []


def test_a_motor_that_saturates_is_not_friction():
    """The drive reports the force that it asks for; at large ones the motor makes less."""
    found = LowSpeedFriction(COULOMB, PERIOD)
    for number in range(5):
        position, force, friction = decelerate(number)
        found.learn(position, force * (1.0 + (force / 60.0) ** 2), friction, COULOMB)
    assert not found.level


def test_a_force_that_differs_from_move_to_move_is_not_taken():
    found = LowSpeedFriction(COULOMB, PERIOD)
    for number, level in enumerate((2.0, -1.5, 0.5, -2.0)):
        found.learn(*decelerate(number, level, 9e-3), COULOMB)
        assert not found.level
    assert found.level == 0.0


def test_one_group_of_moves_alone_shows_nothing():
    """What acts in one direction alone, or at the end of one path, is not friction over speed."""
    found = LowSpeedFriction(COULOMB, PERIOD)
    for number in range(8):
        to = 0.05 * (-1) ** number
        found.learn(*decelerate(number, 2.0 * (to > 0.0), to=to), COULOMB)
        assert not found.level
    for number in range(8):
        found.learn(*decelerate(number, 2.0), COULOMB)
        assert not found.level


def test_a_short_record_says_nothing():
    found = LowSpeedFriction(COULOMB, PERIOD)
    assert not found.learn(*(signal[:40] for signal in decelerate(0)), COULOMB)
    assert found.level == 0.0
