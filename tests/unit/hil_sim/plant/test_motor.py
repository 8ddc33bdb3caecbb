"""Units at the drive's boundary to the plant."""

from __future__ import annotations

import dataclasses

import pytest

from hil_sim.plant import Motor


@pytest.fixture
def make_motor(stage_settings, plant):
    def make(increment=1e-9):
        axis = dataclasses.replace(stage_settings.axes[0], increment=increment)
        settings = dataclasses.replace(stage_settings, axes=(axis, stage_settings.axes[1]))
        return Motor(plant, 0, settings)

    return make


def test_position_is_in_nanometres_whatever_the_increment(make_motor, plant):
    for increment, moved in ((1e-9, 1_000), (5e-9, 5_000), (0.5e-9, 500), (0.4e-9, 400)):
        motor = make_motor(increment)
        plant.actual[0] += 1e-6  # a thousand counts of the plant's encoder
        assert motor.position() == moved


def test_position_saturates_as_integer32(make_motor, plant):
    motor = make_motor()
    plant.actual[0] = 3.0
    assert motor.position() == 2**31 - 1
    plant.actual[0] = -3.0
    assert motor.position() == -(2**31)


def test_force_is_rounded_and_saturates_as_integer16(make_motor, plant):
    motor = make_motor()
    for force, value in ((0.0, 0), (0.0601, 2), (-1.0, -25), (1e4, 32767), (-1e4, -32768)):
        plant.offset[0] = force
        assert motor.force() == value


@pytest.mark.parametrize("origin", [0, 1_234_567, -4_999_999])
def test_a_target_reaches_the_loop_as_exactly_that_many_nanometres(make_motor, plant, origin):
    motor = make_motor()
    motor.origin = origin
    for target in (0, 1, -1, 149_999_999, -123_456_789):
        motor.command(target, 25, 10)
        _, axis, position, force, ticks = plant.commands[-1]
        assert (axis, ticks) == (0, 10)
        assert position == (target + origin) * 1e-9
        assert force == pytest.approx(1.0)
        assert motor.to_drive(motor.to_true(target)) == target
