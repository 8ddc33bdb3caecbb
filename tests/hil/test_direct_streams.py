"""Streams in csv and cst, with the virtual drives in virtual time."""

import itertools

import numpy as np
import pytest

from drivers.drive import Mode
from drivers.errors import AxisFault, ConfigurationError, LimitError
from drivers.objects import MODE_DISPLAY
from hil_sim.cia301 import key
from tests.lockstep import open_on, power_up, switch_on

PERIOD = 1e-3


@pytest.fixture
def switched_on(stage_machine):
    return switch_on(stage_machine)


@pytest.fixture
def drives(switched_on):
    return switched_on[0]


@pytest.fixture
def seen():
    return []


@pytest.fixture
def stage(stage_machine, switched_on, seen):
    with open_on(switched_on[1], stage_machine, lambda t, i, d: seen.append(i)) as stage:
        yield power_up(stage)


def modes(stage):
    return [axis.node.read(MODE_DISPLAY) for axis in stage.axes]


def bell(peak, rows):
    """From 0 to `peak` and back, shape (rows, 2)."""
    shape = np.sin(np.pi * np.arange(1, rows + 1) / rows) ** 2
    shape[-1] = 0.0
    return shape[:, None] * np.array(peak)


def test_velocities_add_up_to_the_distance(stage):
    start = np.array(stage.positions)
    velocity = np.vstack(
        [bell((0.1, -0.05), 400), np.zeros((300, 2))]
    )  # and the loop comes to rest
    samples = stage.stream_velocity(velocity)
    assert modes(stage) == [Mode.CYCLIC_SYNC_VELOCITY] * 2
    assert samples.valid.all()
    np.testing.assert_allclose(samples.position_demand, velocity, atol=1e-9)
    stage.enable()
    assert modes(stage) == [Mode.CYCLIC_SYNC_POSITION] * 2
    rest = stage.hold(0.2)
    np.testing.assert_allclose(rest.position[-1] - start, velocity.sum(axis=0) * PERIOD, atol=1e-6)
    assert np.ptp(rest.position[50:], axis=0).max() < 1e-6


def test_forces_move_the_masses(stage):
    """More than friction for 60 ms: what is over accelerates 8 kg; then friction stops it."""
    force = np.zeros((400, 2))
    force[:60] = (12.0, -12.0)
    samples = stage.stream_force(force)
    assert modes(stage) == [Mode.CYCLIC_SYNC_TORQUE] * 2
    np.testing.assert_allclose(samples.force[10:58], force[10:58], atol=0.05)
    np.testing.assert_allclose(samples.position_demand, force, atol=0.05)
    way = samples.position[-1] - samples.position[0]
    assert way[0] > 5e-4
    assert way[1] < -5e-4
    stage.enable()
    rest = stage.hold(0.1)
    np.testing.assert_allclose(rest.position[-1], samples.position[-1], atol=5e-6)
    stage.stream(np.tile(stage.targets, (5, 1)), np.zeros((5, 2)))


def test_a_stream_ended_early_comes_to_rest(stage):
    velocity = np.full((300, 2), 0.1)
    velocity[:50] = np.linspace(0.01, 0.1, 50)[:, None]
    velocity[-50:] = np.linspace(0.1, 0.0, 50)[:, None]
    count = itertools.count()
    samples = stage.stream_velocity(velocity, until=lambda _: next(count) == 100)
    assert 101 < len(samples) < 130
    assert (samples.position_demand[-1] == 0).all()
    stage.enable()
    assert np.ptp(stage.hold(0.2).position[150:], axis=0).max() < 1e-6
    count = itertools.count()
    samples = stage.stream_force(np.vstack([np.full((50, 2), 10.0), np.zeros((1, 2))]),
                                 until=lambda _: next(count) == 10)  # fmt: skip
    assert (samples.position_demand[-1] == 0).all()
    assert len(samples) == 12


def velocities(*values):
    return np.column_stack([np.zeros(len(values)), values])


def test_setpoints_outside_the_limits_reach_no_drive(stage, seen):
    before = len(seen)
    with pytest.raises(LimitError, match=r"^axis y: 0x60FF:00 .*row 0: 20 m/s\^2 exceeds the acc"):
        stage.stream_velocity(velocities(0.02, 0.01, 0.0))
    with pytest.raises(LimitError, match=r"^axis y: 0x6072:00 .*row 0: 200\.5 N exceeds the force"):
        stage.stream_force(velocities(200.5, 0.0))
    assert len(seen) == before


def test_each_stream_of_velocities_is_checked_from_rest(stage, seen):
    """Also the second one in csv, and whatever the first one ended with."""
    stage.stream_velocity(velocities(0.01, 0.02, 0.01, 0.0))
    before = len(seen)
    with pytest.raises(LimitError, match=r"^axis y: .*row 0: 20 m/s\^2 exceeds the acceleration"):
        stage.stream_velocity(velocities(0.02, 0.01, 0.0))
    assert len(seen) == before
    stage.stream_velocity(velocities(0.01, 0.02, 0.01, 0.0))


def test_positions_are_checked_from_the_target_sent_last(stage, seen):
    """1 mm a SYNC at most, from the last target and not from 0; also back from csv."""
    ramp = np.linspace(0.0, 0.004, 41)[1:, None] * (1.0, -1.0)
    stage.stream(np.array(stage.targets) + ramp, np.zeros_like(ramp))
    stage.hold(0.3)

    def refused():
        for axis, way in itertools.product((0, 1), (1.003e-3, -1.003e-3)):
            position = np.tile(stage.targets, (3, 1))
            position[:, axis] += way  # only the first row is off
            before = len(seen)
            name = "xy"[axis]
            with pytest.raises(LimitError, match=rf"^axis {name}: .*row 0: 1\.003 m/s from"):
                stage.stream(position, np.zeros_like(position))
            assert len(seen) == before

    refused()
    stage.stream_velocity(velocities(0.01, 0.02, 0.01, 0.0))
    stage.enable()
    refused()
    assert len(stage.hold(0.01)) == 10


def test_forces_that_make_an_axis_too_fast_end_the_stream(stage):
    force = np.zeros((2000, 2))
    force[:-1, 0] = 60.0
    with pytest.raises(AxisFault, match=r"^axis x: .*may not stop before the limit 0\.15 m"):
        stage.stream_force(force)
    assert not stage.enabled
    assert abs(stage.positions[0]) < 0.15


def test_a_stream_of_forces_requires_power(stage):
    stage.disable()
    with pytest.raises(AxisFault, match="the stage is not enabled"):
        stage.stream_force(np.zeros((2, 2)))


def test_a_drive_without_the_mode_is_named(stage, drives):
    variable = drives.drives[1].dictionary
    variable.values[key(0x6502)] = 0xA5
    with pytest.raises(ConfigurationError, match=r"^axis y: 0x6502:00 .*cyclic synchronous torque"):
        stage.stream_force(np.zeros((2, 2)))
    assert stage.enabled


def test_a_mode_that_is_not_confirmed_has_a_deadline(stage, drives):
    dictionary = drives.drives[0].dictionary
    dictionary.live[key(0x6061)] = lambda: 8
    with pytest.raises(AxisFault, match=r"^axis x: 0x6061:00 .*shows mode 8 5 s after mode 9"):
        stage.stream_velocity(np.zeros((2, 2)))
    assert not stage.enabled
