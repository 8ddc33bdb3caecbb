"""Delay of a force against the motion, and forces that lost their sign."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.open_loop import find_delay, has_lost_sign, measure_motion
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import ACTUATOR, ROBOT, SCREW, TOOL, sliding, strokes


def with_force(recording, force):
    return replace(recording, axes={"a": replace(recording.axes["a"], force_actual=force)})


def delayed(recording, samples):
    at = np.arange(len(recording))
    return with_force(recording, np.interp(at - samples, at, recording.axes["a"].force_actual))


@pytest.mark.parametrize("samples", [-4, 2.5, 6])
@pytest.mark.parametrize("machine", [SCREW, TOOL])
def test_a_late_or_early_force_is_measured(tmp_path, machine, samples):
    recording, stage = imported(machine, tmp_path)
    motion = measure_motion(delayed(recording, samples), stage)
    found = find_delay(motion, stage.axes[0])
    assert found.value == pytest.approx(samples * motion.period, abs=0.15 * motion.period)
    assert found.sigma < 0.1 * motion.period


@pytest.mark.parametrize("delay", [-0.04, -0.02, 0.02, 0.04])
def test_forces_logged_long_before_or_after_their_motion_are_measured(tmp_path, delay):
    recording, stage = imported(replace(SCREW, duration=10.0), tmp_path)
    motion = measure_motion(delayed(recording, delay * SCREW.rate), stage)
    assert find_delay(motion, stage.axes[0]).value == pytest.approx(delay, abs=5e-4)


@pytest.mark.parametrize("samples", [-1, 0, 1])
@pytest.mark.parametrize("machine", [SCREW, TOOL, ACTUATOR])
def test_a_sample_either_way_is_usual(tmp_path, machine, samples):
    recording, stage = imported(machine, tmp_path)
    assert find_delay(measure_motion(delayed(recording, samples), stage), stage.axes[0]) is None


def test_a_load_behind_a_soft_shaft_is_not_a_delay(tmp_path):
    """Its force is the motor's, of a load that lags and swings near 13 Hz."""

    def force(t, x, v, a):
        load, speed, step = x.copy(), v[0], t[1] - t[0]
        where = x[0]
        for k in range(len(x)):
            pull = 80.0**2 * (x[k] - where) + 12.0 * (v[k] - speed)
            speed += pull * step
            where += speed * step
            load[k] = 60.0 * pull
        ripple = 15.0 * np.sin(2 * np.pi * x / 0.01 + 0.8)
        return 20.0 * a + load + 40.0 * np.tanh(v / 1e-3) + 200.0 * v + ripple

    recording, stage = imported(replace(SCREW, force=force, duration=20.0), tmp_path)
    assert find_delay(measure_motion(recording, stage), stage.axes[0]) is None


@pytest.mark.parametrize("delay", [0.0, 0.03])
def test_a_gear_that_rubs_with_the_weight_of_its_arm_has_no_delay(tmp_path, delay):
    """A delay changes a force over position by the direction of motion, as such friction does."""

    def force(t, q, v, a):
        weight = -4.4 * np.sin(q)
        return 0.46 * a + weight + sliding(v, 0.6, 1.0) + 0.06 * np.abs(weight) * np.sign(v)

    there_and_back = strokes(3.1, (0.3, 0.6, 0.97), 3.0)
    arm = replace(
        ROBOT, motion=lambda t: there_and_back(t) - 2.6, force=force, duration=60.0, rate=100.0
    )
    recording, stage = imported(replace(arm, noise=(1e-5, 0.03)), tmp_path)
    found = find_delay(measure_motion(delayed(recording, delay * arm.rate), stage), stage.axes[0])
    if delay:
        assert found.value == pytest.approx(delay, abs=4e-3)
    else:
        assert found is None


@pytest.mark.parametrize("machine", [SCREW, TOOL])
def test_a_rectified_force_has_lost_its_sign_and_a_weight_has_not(tmp_path, machine):
    recording, stage = imported(machine, tmp_path)
    force = recording.axes["a"].force_actual
    for values, lost in [(np.abs(force), True), (force - 1.1 * force.min(), False), (force, False)]:
        made = with_force(recording, values)
        assert has_lost_sign(measure_motion(made, stage), stage.axes[0], made.axes["a"]) is lost
