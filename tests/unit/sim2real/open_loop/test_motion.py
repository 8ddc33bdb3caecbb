"""Motion and force out of noisy positions."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.open_loop import measure_motion
from stagectl.config.settings.package_settings import stage_settings
from stagectl.importing import import_recording, load_map
from tests.unit.sim2real.other_machines import ROBOT, TOOL


def imported(machine, folder):
    data, how = machine.write(folder)
    columns, model = load_map(how)
    return import_recording(data, columns, model), stage_settings(model)


def with_mass(stage, mass):
    return replace(stage, axes=(replace(stage.axes[0], mass=mass),))


def test_velocity_and_acceleration_are_those_of_the_machine(tmp_path):
    recording, stage = imported(replace(ROBOT, noise=(1e-6, 0.5)), tmp_path)
    moved = measure_motion(recording, with_mass(stage, 1.2)).axes["a"]
    t = np.arange(len(moved.position)) / ROBOT.rate + 0.5 / ROBOT.rate
    velocity = np.gradient(ROBOT.motion(t), t)
    inside = moved.usable
    assert np.std((moved.velocity - velocity)[inside]) < 2e-3 * np.std(velocity)
    exact = np.gradient(velocity, t)
    assert np.std((moved.acceleration - exact)[inside]) < 0.1 * np.std(exact)


def test_a_heavier_axis_needs_a_smoother_motion(tmp_path):
    recording, stage = imported(replace(ROBOT, noise=(5e-5, 0.5)), tmp_path)
    light, heavy = (
        measure_motion(recording, with_mass(stage, mass)).axes["a"] for mass in (0.1, 10.0)
    )
    assert heavy.cutoff < 0.6 * light.cutoff


def test_rests_and_holes_do_not_count(tmp_path):
    recording, stage = imported(TOOL, tmp_path)
    signals = recording.axes["a"]
    valid = signals.valid.copy()
    valid[2000:2020] = False
    holed = replace(recording, axes={"a": replace(signals, valid=valid)})
    motion = measure_motion(holed, with_mass(stage, 300.0))
    own = motion.axes["a"]
    assert not own.usable[1998:2022].any()
    at_rest = np.abs(own.velocity) < 1e-4
    assert own.usable[at_rest].mean() < 0.1
    assert own.usable.mean() > 0.85
    assert own.noise < 20.0  # of 15 N at all frequencies, and of mass times acceleration


def test_moves_are_strokes(tmp_path):
    recording, stage = imported(TOOL, tmp_path)
    moves = measure_motion(recording, with_mass(stage, 300.0)).recording.moves
    lengths = [abs(m.target["a"] - m.origin["a"]) for m in moves]
    assert lengths[:-1] == pytest.approx([0.4] * (len(moves) - 1), abs=0.01)


def test_an_axis_that_is_missing_is_named(tmp_path):
    recording, stage = imported(TOOL, tmp_path)
    other = replace(stage, axes=(replace(stage.axes[0], name="b"),))
    with pytest.raises(ValueError, match="axis b: not in the recording"):
        measure_motion(recording, other)
