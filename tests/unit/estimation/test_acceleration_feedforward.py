"""Force offsets for the mass: through the corners of the profile, and what they do in the loop."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.acceleration_feedforward import against_lag, chord_force, mass_feedforward
from estimation.friction import FrictionState, friction_feedforward
from estimation.trajectory import Limits, plan
from hil_sim.plant import simulate
from stagectl.config import load_machine, stage_settings
from stagectl.config.settings.host_model import drive_loop

TS, TC = 1e-3, 1e-4
LIMITS = Limits(0.5, 3.0, 200.0)
AXIS = load_machine().axes["x"]
LAG = 1.0 / (2.0 * np.pi * AXIS.drive.current_bandwidth)


def reached(ramped):
    """Positions at SYNC of an axis of 1 kg under forces ramped between SYNCs."""
    position = speed = before = 0.0
    found = []
    for after in ramped:
        position += TS * speed + TS**2 * (before / 3.0 + after / 6.0)
        speed += TS * (before + after) / 2.0
        before = after
        found.append(position)
    return np.array(found)


@pytest.mark.parametrize("distance", [25e-3, 25.2e-3, 57e-6])
def test_ramped_between_syncs_the_acceleration_leads_from_setpoint_to_setpoint(distance):
    """Wherever in a period the corners of the profile are."""
    motion = plan(0.0, distance, LIMITS)
    count = int(np.ceil(motion.duration / TS)) + 3
    wanted, _, sampled = motion.sample(TS * np.arange(1, count + 1))
    off = np.abs(reached(mass_feedforward(1.0, motion, count, TS, 0.0)) - wanted).max()
    assert off < 1e-8
    assert off < 0.1 * np.abs(reached(sampled) - wanted).max()


def test_a_force_comes_ahead_of_its_time():
    motion = plan(0.0, 25e-3, LIMITS)
    force = mass_feedforward(8.0, motion, 10, TS, 0.5e-3)
    np.testing.assert_allclose(force[1:], 8.0 * 200.0 * (np.arange(2, 11) * TS + 0.5e-3), rtol=1e-6)


@pytest.mark.parametrize("lag", [0.1e-3, 0.6e-3])
def test_behind_the_lag_the_force_is_the_one_that_was_wanted(lag):
    motion = plan(0.0, 25e-3, LIMITS)
    wanted = np.append(0.0, mass_feedforward(8.0, motion, 260, TS, 0.0))
    fine = np.arange(260 * 50 + 1) * (TS / 50)

    def behind(offsets):
        ramped, force = np.interp(fine, np.arange(261) * TS, offsets), 0.0
        result = []
        for now in ramped:
            force += (now - force) * -np.expm1(-TS / 50 / lag)
            result.append(force)
        return np.array(result)

    def velocity_error(force):
        return np.abs(np.cumsum(force - np.interp(fine, np.arange(261) * TS, wanted))).max()

    made_up = behind(np.append(0.0, against_lag(wanted[1:], lag, TS)))
    assert velocity_error(made_up) < 0.3 * velocity_error(behind(wanted))
    assert abs(made_up[-1] - wanted[-1]) < 1e-6
    again = against_lag(wanted[101:] - wanted[100], lag, TS, moving=True)
    whole = against_lag(wanted[1:], lag, TS)
    np.testing.assert_allclose(again[1:], (whole[100:] - whole[99])[1:], atol=0.2 * lag / TS)


def following_error(distance, offset, stage):
    """Largest deviation from the planned motion [m]."""
    motion = plan(0.0, distance, LIMITS)
    rows = int(np.ceil(motion.duration / TS)) + 30
    setpoints = motion.sample(TS * np.arange(rows))[0]
    offsets = np.append(0.0, offset(motion, rows - 1))
    response = simulate(stage, setpoints[:, None], offsets[:, None], None)
    smooth = motion.sample(TS * (np.arange(rows) - 1) + TC)[0]
    error = response.position[:, 0] - smooth
    return np.abs(error).max()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_in_the_loop_the_axis_follows_the_planned_motion(sign):
    """With everything known, friction too; beside accelerations sampled ahead by the lag."""
    whole = stage_settings(load_machine())
    quiet = replace(whole, axes=(replace(whole.axes[0], noise=0.0, wander=0.0),))
    loop, friction = drive_loop(AXIS.drive), AXIS.plant.friction.figures
    assert loop is not None

    def sampled(motion, count):
        time = TS * np.arange(1, count + 1) + TC / 2.0 + LAG
        relaxed = FrictionState.relaxed(friction.elements)
        ahead = TC / 2.0 + LAG
        return 8.0 * motion.sample(time)[2] + friction_feedforward(
            friction, relaxed, motion, count, TS, ahead
        )

    def made(motion, count):
        relaxed = FrictionState.relaxed(friction.elements)
        force = mass_feedforward(8.0, motion, count, TS, TC / 2.0)
        force += friction_feedforward(friction, relaxed, motion, count, TS, TC / 2.0)
        return against_lag(force, LAG, TS) - chord_force(loop, motion, count, TS)

    before, after = (following_error(sign * 25e-3, how, quiet) for how in (sampled, made))
    assert after < 0.3 * before
