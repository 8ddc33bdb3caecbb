"""Figures that a machine file leaves unknown."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.open_loop import fit_figures, measure_motion
from stagectl.config import stage_settings
from stagectl.importing import import_recording, load_map
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import ACTUATOR, BELT, ROBOT, TOOL, sliding, strokes, swings


def test_figures_beside_a_force_that_is_nobodys(tmp_path):
    recording, stage = imported(TOOL, tmp_path)
    found = fit_figures([measure_motion(recording, stage)], stage, {"a": ("mass", "coulomb")})
    axis = fit_figures(
        [measure_motion(recording, found)], stage, {"a": ("mass", "coulomb", "viscous")}
    ).axes[0]
    assert axis.mass == pytest.approx(300.0, rel=0.02)
    assert axis.friction.coulomb == pytest.approx(250.0, rel=0.02)
    assert axis.friction.viscous == pytest.approx(400.0, rel=0.05)


def test_a_coarse_position_does_not_make_the_axis_lighter(tmp_path):
    """Least squares take noise of the acceleration for acceleration that takes no force."""
    recording, stage = imported(replace(BELT, noise=(2e-4, 4.0)), tmp_path)
    for _ in range(2):
        stage = fit_figures([measure_motion(recording, stage)], stage, {"a": ("mass", "coulomb")})
    assert stage.axes[0].mass == pytest.approx(12.0, rel=0.04)


def test_figures_beside_friction_that_fades(tmp_path):
    recording, stage = imported(ACTUATOR, tmp_path)
    unknown = {"a": ("mass", "coulomb", "viscous", "stiffness")}
    axis = fit_figures([measure_motion(recording, stage)], stage, unknown).axes[0]
    assert axis.friction.viscous == pytest.approx(4.0, rel=0.15)


def test_what_is_known_stays(tmp_path):
    recording, stage = imported(replace(BELT, known=("12", "20", "18")), tmp_path)
    motion = measure_motion(recording, stage)
    axis = fit_figures([motion], stage, {"a": ("coulomb",)}).axes[0]
    assert (axis.mass, axis.friction.viscous) == (12.0, 18.0)
    assert axis.friction.stiffness == stage.axes[0].friction.stiffness


@pytest.mark.parametrize("reach", [2e-4, 5e-3])
def test_the_length_of_presliding_is_found(tmp_path, reach):
    """Dahl's friction, which approaches its level exponentially over that length [rad]."""

    def force(t, q, v, a):
        spring = np.zeros_like(q)
        for k in range(1, len(q)):
            step = q[k] - q[k - 1]
            end = np.sign(step)
            spring[k] = end + (spring[k - 1] - end) * np.exp(-abs(step) / reach)
        return 1.2 * a + 4.0 * spring + 3.0 * v

    machine = replace(ROBOT, force=force, noise=(1e-6, 0.1))
    recording, stage = imported(machine, tmp_path)
    unknown = {"a": ("mass", "coulomb", "viscous", "stiffness")}
    axis = fit_figures([measure_motion(recording, stage)], stage, unknown).axes[0]
    found = axis.friction.coulomb / axis.friction.stiffness
    assert reach / 3.0 < found < 3.0 * reach
    assert axis.mass == pytest.approx(1.2, rel=0.01)
    assert axis.friction.coulomb == pytest.approx(4.0, rel=0.1)
    assert axis.friction.viscous == pytest.approx(3.0, rel=0.1)


def test_a_slow_log_in_coarse_steps_does_not_tell_the_mass(tmp_path):
    """10 Hz and 1 mm, of strokes of 20 mm."""
    machine = replace(TOOL, rate=10.0, motion=strokes(0.02, (0.01, 0.02), 0.5))
    recording, stage = imported(machine, tmp_path)
    a = recording.axes["a"]
    coarse = replace(a, position_actual=np.round(a.position_actual, 3))
    motion = measure_motion(replace(recording, axes={"a": coarse}), stage)
    with pytest.raises(ValueError, match=r"does not tell it .* state an estimate"):
        fit_figures([motion], stage, {"a": ("mass", "coulomb", "viscous")})


@pytest.mark.parametrize("rate", [10.0, 25.0])
def test_a_slow_log_gives_figures_whatever_its_control_period(tmp_path, rate):
    """An unknown stiffness is no affair of the step in which a loop would be simulated."""
    data, how = replace(TOOL, rate=rate).write(tmp_path)
    file = tmp_path / "machine.yaml"
    slow = file.read_text().replace("control_period: 0.001", f"control_period: {1.0 / rate}")
    file.write_text(slow)
    columns, model = load_map(how)
    recording, stage = import_recording(data, columns, model), stage_settings(model)
    motion = measure_motion(recording, stage)
    found = fit_figures([motion], stage, {"a": ("mass", "coulomb", "viscous", "stiffness")})
    assert found.axes[0].mass == pytest.approx(300.0, rel=0.1)


def test_a_motion_that_does_not_tell_the_mass_says_so(tmp_path):
    machine = replace(
        ROBOT,
        rate=100.0,
        motion=swings((0.8, 0.2), (0.06, 0.13)),
        force=lambda t, x, v, a: sliding(v, 4.0, 3.0),
        noise=(1e-5, 5.0),
        seed=6,
    )
    recording, stage = imported(machine, tmp_path)
    words = "does not tell it .* kg m².: state an estimate in the machine file"
    motions, unknown = [measure_motion(recording, stage)], {"a": ("mass", "coulomb", "viscous")}
    with pytest.raises(ValueError, match=words):
        fit_figures(motions, stage, unknown)
    # Enough to choose a cutoff by, at which it may be told.
    assert 0.0 < fit_figures(motions, stage, unknown, is_rough=True).axes[0].mass < 5.0


@pytest.mark.parametrize("seed", [3, 6, 8])
def test_a_mass_that_hardly_matters_need_not_be_known(tmp_path, seed):
    """A joint whose accelerations take a thousandth of its friction: other figures are found."""
    machine = replace(
        ROBOT,
        rate=100.0,
        motion=swings((0.8, 0.2), (0.06, 0.13)),
        force=lambda t, x, v, a: 0.01 * a + sliding(v, 4.0, 3.0) + 15.0 * np.sin(x),
        noise=(1e-6, 0.3),
        seed=seed,
    )
    recording, stage = imported(machine, tmp_path)
    motion = measure_motion(recording, stage)
    axis = fit_figures([motion], stage, {"a": ("mass", "coulomb", "viscous")}).axes[0]
    acceleration = motion.axes["a"].acceleration
    assert 0.0 < axis.mass * np.std(acceleration) < 0.4
    assert axis.friction.coulomb == pytest.approx(4.0, rel=0.1)
