"""Setpoints are checked against the limits before anything is sent."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import LimitError
from drivers.motion.limits import (
    Setpoint,
    check_profile,
    checked_forces,
    checked_positions,
    checked_profile,
    checked_velocities,
)
from drivers.settings import AxisSettings

TS = 1e-3


def test_setpoints_are_rounded_to_increments_and_permille(axis_settings):
    position = np.array([[1.4e-9, -1.6e-9], [2.6e-9, -2.4e-9]])
    offset = np.array([[0.05, -0.1], [-1e9, 1e9]])
    targets, offsets = checked_positions(position, offset, axis_settings, (0, 0), TS)
    assert targets.tolist() == [[1, -2], [3, -2]]
    assert offsets.tolist() == [[1, -2], [-32768, 32767]]


def test_the_limits_themselves_are_allowed(axis_settings):
    speed = axis_settings[0].velocity
    x = np.minimum(0.145 + np.arange(1, 11) * speed * TS, 0.15)
    position = np.stack([x, np.full(10, -0.15)], axis=1)
    checked_positions(position, 0 * position, axis_settings, (145_000_000, -150_000_000), TS)


@pytest.mark.parametrize(
    ("row", "axis", "value", "text"),
    [
        (2, 0, 0.1500001, r"axis x: 0x607D:02 max position limit: row 2: .* above the limit 0.15"),
        (4, 1, -0.151, r"axis y: 0x607D:01 min position limit: row 4: .* below the limit -0.15"),
        (1, 1, np.inf, r"axis y: 0x607A:00 target position: row 1: inf m is not finite"),
        (3, 0, 0.00101, r"axis x: 0x607A:00 .*row 3: 1.01 m/s .* exceeds the velocity limit 1 m/s"),
    ],
)
def test_the_first_position_outside_the_limits_is_named(axis_settings, row, axis, value, text):
    position = np.zeros((6, 2))
    position[row, axis] = value
    with pytest.raises(LimitError, match=text):
        checked_positions(position, np.zeros((6, 2)), axis_settings, (0, 0), TS)


def test_an_offset_that_is_not_finite_is_named(axis_settings):
    offset = np.zeros((3, 2))
    offset[1, 1] = np.nan
    with pytest.raises(LimitError, match=r"axis y: 0x60B2:00 torque offset: row 1: nan N"):
        checked_positions(np.zeros((3, 2)), offset, axis_settings, (0, 0), TS)


@given(
    st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=8), st.integers(-150_000_000, 150_000_000)
)
def test_accepted_positions_are_within_travel_and_velocity(steps, last):
    axis = AxisSettings(
        "x", 1, Path("none.eds"), 40.0, 120.0, (-0.15, 0.15), 1.0, 10.0, 2000.0, 1e-3
    )
    position = last * 1e-9 + np.cumsum(steps).reshape(-1, 1) * 1e-2
    try:
        targets, _ = checked_positions(position, 0 * position, [axis], (last,), TS)
    except LimitError:
        return
    assert np.abs(targets).max() <= 150_000_000
    assert np.abs(np.diff(targets[:, 0], prepend=last)).max() <= 1_000_002


def alone(axis, *values):
    """Rows of two axes, of which one stays 0."""
    rows = np.zeros((len(values), 2))
    rows[:, axis] = values
    return rows


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_first_position_is_checked_from_the_target_sent_last(axis_settings, axis, sign):
    last = [0, 0]
    last[axis] = sign * 100_000_000
    there = alone(axis, 0.1, 0.1) * sign
    checked_positions(there, 0 * there, axis_settings, last, TS)
    checked_positions(there + alone(axis, 1e-3, 1e-3), 0 * there, axis_settings, last, TS)
    for far in (alone(axis, 1.003e-3, 1.003e-3), alone(axis, -1.003e-3, -1.003e-3)):
        with pytest.raises(LimitError, match=rf"axis {'xy'[axis]}: .*row 0: 1\.003 m/s from"):
            checked_positions(there + far, 0 * there, axis_settings, last, TS)
    with pytest.raises(LimitError, match=r"row 0: 100 m/s from the previous setpoint"):
        checked_positions(there, 0 * there, axis_settings, (0, 0), TS)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_first_velocity_is_checked_from_rest(axis_settings, axis, sign):
    """0.01 m/s in a SYNC of 1 ms are 10 m/s^2: what follows keeps within that."""
    for values, row, found in (
        ((0.02, 0.01, 0.0), 0, "20"),
        ((0.02, 0.02, 0.01, 0.0), 0, "20"),
        ((0.01, 0.025, 0.015, 0.005, 0.0), 1, "15"),
        ((0.01, 0.012, 0.0), 2, "12"),
    ):
        velocity = sign * alone(axis, *values)
        text = rf"axis {'xy'[axis]}: 0x60FF:00 .*row {row}: {found} m/s\^2 exceeds the acceleration"
        with pytest.raises(LimitError, match=text):
            checked_velocities(velocity, 0 * velocity, axis_settings, (0.0, 0.0), TS)
    velocity = sign * alone(axis, 0.01, 0.02, 0.01, 0.0)
    targets, _ = checked_velocities(velocity, 0 * velocity, axis_settings, (0.0, 0.0), TS)
    assert targets.dtype == np.int64
    assert targets[:, axis].tolist() == [sign * v for v in (10_000_000, 20_000_000, 10_000_000, 0)]


@pytest.mark.parametrize("sign", [1, -1])
def test_the_first_velocity_counts_towards_the_travel(axis_settings, sign):
    """10 um in a SYNC, from 5 um before the end of the travel."""
    velocity = sign * alone(1, 0.01, 0.0)
    start = (0.0, sign * (0.15 - 5e-6))
    with pytest.raises(LimitError, match=r"axis y: 0x607D:0[12] .*row 0: leads to -?0\.150005 m"):
        checked_velocities(velocity, 0 * velocity, axis_settings, start, TS)
    checked_velocities(-velocity, 0 * velocity, axis_settings, start, TS)


@pytest.mark.parametrize(("axis", "limit"), [(0, 120.0), (1, 200.0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_first_force_is_checked_against_the_peak_force(axis_settings, axis, limit, sign):
    allowed = sign * alone(axis, limit, 0.0)
    targets = checked_forces(allowed, axis_settings)
    assert targets[0, axis] == sign * round(limit / axis_settings[axis].rated_force * 1000)
    text = rf"axis {'xy'[axis]}: 0x6072:00 .*row 0: .* N exceeds the force limit {limit:g} N"
    with pytest.raises(LimitError, match=text):
        checked_forces(allowed * 1.001, axis_settings)
    with pytest.raises(
        LimitError, match=rf"axis {'xy'[axis]}: 0x6071:00 .*row 1: the last setpoint"
    ):
        checked_forces(allowed[::-1], axis_settings)


def test_rounding_alone_exceeds_no_limit(axis_settings):
    """Half an increment beyond the travel, one and a half beyond the way of a SYNC."""
    for sign in (1, -1):
        end, last = sign * 0.15, (sign * 150_000_000, 0)
        near, far = alone(0, end + sign * 0.4e-9), alone(0, end + sign * 0.6e-9)
        targets, _ = checked_positions(near, 0 * near, axis_settings, last, TS)
        assert targets[0, 0] == last[0]
        with pytest.raises(LimitError, match=r"the limit -?0\.15 m"):
            checked_positions(far, 0 * far, axis_settings, last, TS)
        near, far = sign * alone(0, 1.000001e-3), sign * alone(0, 1.000002e-3)
        checked_positions(near, 0 * near, axis_settings, (0, 0), TS)
        with pytest.raises(LimitError, match="exceeds the velocity limit"):
            checked_positions(far, 0 * far, axis_settings, (0, 0), TS)


def test_velocities_may_lead_to_the_end_of_the_travel(axis_settings):
    for sign, side in (
        (1, r"0x607D:02 .*above the limit 0\.15"),
        (-1, r"0x607D:01 .*below the limit -0\.15"),
    ):
        velocity, start = sign * alone(0, 0.01, 0.0), sign * (0.15 - 1e-5)
        checked_velocities(velocity, 0 * velocity, axis_settings, (start, 0.0), TS)
        start += sign * 2e-9
        with pytest.raises(LimitError, match=side):
            checked_velocities(velocity, 0 * velocity, axis_settings, (start, 0.0), TS)


@pytest.mark.parametrize(
    ("velocity", "offset", "text"),
    [
        ((0.0, np.inf, 0.0), (0.0, 0.0, 0.0), r"0x60FF:00 .*row 1: inf m/s is not finite"),
        ((0.0, 0.0, 0.0), (0.0, np.nan, 0.0), r"0x60B2:00 .*row 1: nan N is not finite"),
        ((0.0, -1.01, 0.0), (0.0, 0.0, 0.0), r"0x60FF:00 .*row 1: 1.01 m/s exceeds the velocity"),
        ((0.0, 0.0, 0.005), (0.0, 0.0, 0.0), r"0x60FF:00 .*row 2: the last setpoint must be 0"),
    ],
)
def test_the_first_velocity_outside_the_limits_is_named(axis_settings, velocity, offset, text):
    rows = alone(1, *velocity), alone(1, *offset)
    with pytest.raises(LimitError, match=rf"^axis y: {text}"):
        checked_velocities(*rows, axis_settings, (0.0, 0.0), TS)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_force_that_is_not_finite_is_named(axis_settings, value):
    with pytest.raises(LimitError, match=rf"^axis y: 0x6071:00 .*row 1: {value} N is not finite"):
        checked_forces(alone(1, 0.0, value, 0.0), axis_settings)


@pytest.mark.parametrize(
    ("values", "offset"), [((3, 1), (3, 1)), ((2,), (2,)), ((3, 2), (2, 2)), ((3, 3), (3, 3))]
)
def test_wrong_shapes_are_refused(axis_settings, values, offset):
    text = f"and their offsets must be [K, 2], are {list(values)} and {list(offset)}"
    for check, start in ((checked_positions, (0, 0)), (checked_velocities, (0.0, 0.0))):
        with pytest.raises(LimitError, match=re.escape(text)):
            check(np.zeros(values), np.zeros(offset), axis_settings, start, TS)
    if values == offset:
        with pytest.raises(LimitError, match=r"must be \[K, 2\]"):
            checked_forces(np.zeros(values), axis_settings)


def test_a_profile_may_use_its_limits_and_has_the_right_duration(axis_settings):
    """At 1 m/s and 10 m/s^2: the way at full speed, and 0.1 s for both ramps."""
    x = axis_settings[0]
    assert checked_profile(x, 0.1, [-0.15, 0.15], 1.0, 10.0, False) == [
        Setpoint(-150_000_000, -150_000_000, pytest.approx(0.25 + 0.1), False),
        Setpoint(150_000_000, 150_000_000, pytest.approx(0.3 + 0.1), False),
    ]
    assert checked_profile(x, 0.1, [-0.25, 0.1], 0.5, 5.0, True) == [
        Setpoint(-250_000_000, -150_000_000, pytest.approx(0.5 + 0.1), True),
        Setpoint(100_000_000, -50_000_000, pytest.approx(0.2 + 0.1), True),
    ]


TENTH, FIFTH, NINE = np.array([0.1, 0.2, 9.0])
"""Positions and speeds come out of arrays, too; they are told in plain figures."""


@pytest.mark.parametrize(
    ("positions", "velocity", "acceleration", "relative", "text"),
    [
        ([-0.151], 1.0, 10.0, False, "0x607D:01 min position limit: target -0.151 m is below the "),
        ([0.1, 0.06], 1.0, 10.0, True, "0x607D:02 .*: target 2: target 0.16 m is above the limit "),
        ([TENTH, FIFTH], 1.0, 10.0, True, r".*limit: .*target 0\.3 m is above the limit 0\.15 m$"),
        ([np.nan], 1.0, 10.0, False, "0x607D:02 max position limit: target nan m is above the "),
        ([], 1.0, 10.0, False, "0x607A:00 .*: no target given"),
        ([0.1], 0.0, 10.0, False, r"0x6081:00 .*: 0 is not in \(0, 1\]"),
        ([0.1], -0.5, 10.0, False, r"0x6081:00 .*: -0\.5 is not in \(0, 1\]"),
        ([0.1], 1.001, 10.0, False, r"0x6081:00 .*: 1\.001 is not in \(0, 1\]"),
        ([0.1], NINE, 10.0, False, r"0x6081:00 .*: 9 is not in \(0, 1\]$"),
        ([0.1], 1.0, 0.0, False, r"0x6083:00 .*: 0 is not in \(0, 10\]"),
        ([0.1], 1.0, np.nan, False, r"0x6083:00 .*: nan is not in \(0, 10\]"),
        ([0.1], 1.0, 10.01, False, r"0x6083:00 .*: 10\.01 is not in \(0, 10\]"),
    ],
)
def test_a_profile_outside_the_limits_is_named(
    axis_settings, positions, velocity, acceleration, relative, text
):
    with pytest.raises(LimitError, match=rf"^axis x: {text}"):
        checked_profile(axis_settings[0], 0.0, positions, velocity, acceleration, relative)


@pytest.mark.parametrize(
    ("velocity", "acceleration", "line"),
    [
        (0.4e-3, 1.0, "0x6081:00 profile velocity: 0.0004 is nothing in steps of 0.001 m/s"),
        (0.1, 0.004, "0x6083:00 profile acceleration: 0.004 is nothing in steps of 0.01 m/s^2"),
    ],
)
def test_a_profile_that_is_nothing_in_the_drives_units_is_refused(
    axis_settings, velocity, acceleration, line
):
    coarse = dataclasses.replace(axis_settings[0], velocity_unit=1e-3, acceleration_unit=1e-2)
    check_profile(coarse, 0.6e-3, 0.006)
    with pytest.raises(LimitError, match=f"^axis x: {re.escape(line)}$"):
        check_profile(coarse, velocity, acceleration)
