"""Machine files that leave to the log what it knows."""

from dataclasses import replace

import numpy as np
import pytest

from stagectl.config import parse_machine
from stagectl.errors import ConfigError, UnusableInput
from stagectl.importing import import_recording, load_map
from stagectl.importing.log_machine import load_machine_of
from tests.unit.sim2real.other_machines import BELT, ROBOT, TOOL, strokes

LOG = "machine: press\naxes:\n  a:\n    plant: {mass: unknown, friction: unknown}\n"
SHORT = replace(TOOL, motion=strokes(0.4, (0.3,), 1.0), duration=12.0)


def imported(machine, folder, text=LOG):
    data, how = machine.write(folder)
    (folder / "machine.yaml").write_text(text)
    recording = import_recording(data, *load_map(how))
    return recording, parse_machine(recording.machine, "completed", fitted=True)


def test_what_a_machine_file_leaves_out_is_as_the_log_has_it(tmp_path):
    recording, machine = imported(SHORT, tmp_path)
    a, moved = machine.axes["a"], recording.axes["a"]
    assert machine.bus.sync_period == pytest.approx(0.01)
    assert a.travel[0] < moved.position_actual.min() < moved.position_actual.max() < a.travel[1]
    assert a.limits.velocity == pytest.approx(0.36, rel=0.02)
    assert 1.0 < a.limits.acceleration < 2.0
    assert a.drive.rated_force == pytest.approx(np.abs(moved.force_actual).max(), rel=1e-3)
    assert {"mass", "coulomb", "viscous", "stiffness", "gains"} <= set(machine.unknown["a"])
    assert a.plant.friction.model == "gms"


@pytest.mark.parametrize("period", [1.0 / 300.0, 0.02])
def test_the_period_is_that_of_the_log(tmp_path, period):
    recording, machine = imported(replace(SHORT, rate=1.0 / period), tmp_path)
    assert machine.bus.sync_period == pytest.approx(period, rel=1e-5)
    assert machine.bus.sync_period % machine.axes["a"].drive.control_period == pytest.approx(
        0.0, abs=1e-9
    )
    assert len(recording) == round(12.0 / period)


def test_uneven_samples_are_not_blamed_on_the_machine_file(tmp_path):
    data, how = SHORT.write(tmp_path)
    (tmp_path / "machine.yaml").write_text(LOG)
    head, *rows = data.read_text().splitlines()
    kept = [row for number, row in enumerate(rows) if number < 300 or number % 2]
    data.write_text("\n".join([head, *kept]))
    with pytest.raises(UnusableInput, match=r"samples are 0.0[12] s apart, their mean is 0.01\d+"):
        import_recording(data, *load_map(how))


@pytest.mark.parametrize("stated", ["0.0002", "0.2 ms"])
def test_a_log_without_times_needs_no_more_of_the_bus_than_its_period(tmp_path, stated):
    """Also where it is shorter than the control period of most drives."""
    _, how = SHORT.write(tmp_path)
    (tmp_path / "machine.yaml").write_text(f"bus: {{sync_period: {stated}}}\n{LOG}")
    how.write_text(how.read_text().replace("time: {column: time}\n", ""))
    recording = import_recording(tmp_path / "log.csv", *load_map(how))
    machine = parse_machine(recording.machine, "completed", fitted=True)
    assert machine.bus.sync_period == 2e-4
    assert machine.axes["a"].drive.control_period == 2e-4
    assert recording.time[1] == 2e-4


def test_what_it_says_stays(tmp_path):
    text = LOG + "    travel: [-1, 2]\n    rotary: true\n    drive: {rated_force: 2 kN}\n"
    _, machine = imported(SHORT, tmp_path, text)
    a = machine.axes["a"]
    assert (a.travel, a.rotary, a.drive.rated_force) == ((-1.0, 2.0), True, 2000.0)


def test_logs_that_are_fitted_together_complete_a_file_together(tmp_path):
    """Each has been elsewhere, at another speed."""
    for name in ("slow", "far"):
        (tmp_path / name).mkdir()
    slow, _ = imported(SHORT, tmp_path / "slow")
    moved = SHORT.motion
    far, of_far = imported(replace(SHORT, motion=lambda t: 2.0 * moved(t)), tmp_path / "far")
    file = tmp_path / "slow" / "machine.yaml"
    both = load_machine_of(file, [slow, far]).axes["a"]
    assert both.travel == of_far.axes["a"].travel
    assert both.limits == of_far.axes["a"].limits
    other = replace(far, axes={"b": far.axes["a"]}, moves=())
    with pytest.raises(UnusableInput, match=r"machine\.yaml: has axes a, .* b$"):
        load_machine_of(file, [slow, other])
    with pytest.raises(ConfigError, match="missing"):
        load_machine_of(file, [replace(slow, machine="of a run")])


def test_any_mass_may_be_stated(tmp_path):
    """No force of a drive is known that could be too small for it."""
    _, machine = imported(SHORT, tmp_path, LOG.replace("mass: unknown", "mass: 5000"))
    assert machine.axes["a"].plant.mass == 5000.0


def test_turns_of_a_joint_are_counted(tmp_path):
    many = replace(ROBOT, motion=lambda t: 40.0 * ROBOT.motion(t), duration=5.0)
    _, machine = imported(many, tmp_path, LOG + "    rotary: true\n")
    assert machine.axes["a"].travel[1] > 10.0


def test_units_that_only_the_file_can_state_are_asked_for(tmp_path):
    with pytest.raises(ConfigError, match=r"force_actual\.unit: the machine file has no drive"):
        imported(BELT, tmp_path)


def test_without_times_the_period_is_asked_for(tmp_path):
    _, how = SHORT.write(tmp_path)
    (tmp_path / "machine.yaml").write_text(LOG)
    how.write_text(how.read_text().replace("time: {column: time}\n", ""))
    with pytest.raises(ConfigError, match=r"no bus\.sync_period, and the map no time"):
        load_map(how)


def test_without_a_demand_strokes_are_moves(tmp_path):
    """Of 1.63 s each, with a rest of 0.25 s, from 0.3 s on; noise of 1 um is no motion."""
    recording, _ = imported(SHORT, tmp_path)
    assert len(recording.moves) == 7
    assert {round(abs(m.target["a"] - m.origin["a"]), 2) for m in recording.moves[:-1]} == {0.4}
