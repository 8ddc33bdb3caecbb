"""What drives say they count in (0x60A8 to 0x60AA): refused, or moved at the speed asked for."""

import struct

import numpy as np
import pytest
from click.testing import CliRunner

from drivers import objects as od
from drivers.drive import unit
from drivers.errors import ConfigurationError
from drivers.objects import ObjectRef
from hil_sim.cia301 import key
from stagectl.cli import cli
from stagectl.config import parse_machine
from stagectl.errors import RunFault
from tests.lockstep import open_on, open_stage, power_up, switch_on
from tests.short_recipe import short_recipe

START = (-5e-3, -4e-3)
VELOCITY, ACCELERATION = key(0x60A9), key(0x60AA)
RPM, RPM_PER_SECOND = 0x00B44700, 0x00C00300
MILLIMETRES_PER_MINUTE = 0xFD014700
POSITION, TENTHS_OF_A_DEGREE = key(0x60A8), 0xFF410000


class Drives:
    """Virtual drives that are switched on, and what they say they count in.

    Args:
        machine: of the drives.
        says: values of their objects by key; None: the drives lack it.
    """

    def __init__(self, machine, says):
        self.machine = machine
        self.stage, self.world = switch_on(machine, start=START)
        self.was_enabled = False
        for drive in self.stage.drives:
            for place, value in says.items():
                if value is None:
                    del drive.dictionary.variables[place]
                else:
                    drive.dictionary.values[place] = value
            act = drive.dictionary.on_write[key(0x6040)]
            drive.dictionary.on_write[key(0x6040)] = lambda word, act=act: self._see(word, act)

    def _see(self, word, act):
        self.was_enabled |= word & 0x8F == 0x0F
        return act(word)

    def open(self):
        return open_on(self.world, self.machine, homing_method=None)

    @property
    def positions(self):
        return np.array([d.dictionary.integer(key(0x6064)) for d in self.stage.drives])


def with_units(machine, **units):
    """The machine with these units written in both drive sections."""
    lines = "".join(f"{name}: {value}\n      " for name, value in units.items())
    text = machine.text
    for rated in ("rated_force: 40.0", "rated_force: 60.0"):
        text = text.replace(rated, lines + rated)
    return parse_machine(text, "units.yaml")


def refused(drives, command, folder, *options):
    """The one line with which a command refuses the drives, before power."""
    before = drives.positions
    recipe = folder / "r.yaml"
    recipe.write_text(short_recipe((0.01, 0.0)), encoding="utf-8")
    machine = folder / "m.yaml"
    machine.write_text(drives.machine.text, encoding="utf-8")
    arguments = {
        "jog": ["x", "2mm", "--velocity", "5mm/s"],
        "home": [],
        "enable": ["--hold", "0.1"],
        "run": [str(recipe), "--out", str(folder / "out"), "--compensation", "none"],
    }[command]
    where = ["--machine", str(machine), "--bus", f"lockstep:{drives.world.name}"]
    done = CliRunner().invoke(cli, [command, *arguments, *options, *where])
    assert isinstance(done.exception, RunFault), done.output
    assert done.exception.exit_code == 3
    assert not drives.was_enabled
    np.testing.assert_allclose(drives.positions, before, atol=20)
    return str(done.exception)


@pytest.mark.parametrize("command", ["jog", "home", "enable", "run"])
def test_a_drive_that_counts_in_rpm_is_refused_before_power(command, stage_machine, tmp_path):
    drives = Drives(stage_machine, {VELOCITY: RPM, ACCELERATION: RPM_PER_SECOND})
    assert refused(drives, command, tmp_path) == (
        "axis x: 0x60A9:00 SI unit velocity: says 0x00B44700: revolutions per minute; a linear "
        "axis cannot use it for velocity without lead, the travel per revolution, in its drive "
        "section"
    )


@pytest.mark.parametrize(
    ("command", "index", "mode"),
    [
        ("home", 0x6098, "homing"),
        ("run", 0x6098, "homing"),
        ("jog", 0x6098, "homing"),
        ("jog", 0x6081, "profile position"),
        ("jog", 0x6083, "profile position"),
        ("jog", 0x6084, "profile position"),
    ],
)
def test_a_drive_without_an_object_of_the_mode_is_refused_before_power(
    command, index, mode, stage_machine, tmp_path
):
    line = refused(Drives(stage_machine, {key(index): None}), command, tmp_path)
    assert line.startswith(f"axis x: 0x{index:04X}:00 ")
    assert line.endswith(f": is not offered: {mode} mode needs it")


def test_moves_that_the_drive_cannot_be_told_leave_an_enabled_axis_alone(stage_machine):
    drives = Drives(stage_machine, {key(0x6083): None})
    with drives.open() as stage:
        stage.boot()
        stage.enable()
        before = drives.positions
        with pytest.raises(ConfigurationError, match=r"^axis x: 0x6083:00 .*is not offered"):
            stage.move_to("x", stage.targets[0] + 1e-3, velocity=0.05, acceleration=1.0)
        with (
            pytest.raises(ConfigurationError, match=r"^axis x: 0x6083:00 .*is not offered"),
            stage.profile_moves(velocity=0.05, acceleration=1.0),
        ):
            pytest.fail("no moves without a profile")
        assert stage.enabled
        stage.hold(0.01)
        np.testing.assert_allclose(drives.positions, before, atol=100)


RATES = [
    ({"velocity_unit": "1 um/s", "acceleration_unit": "1 mm/s^2"}, {}),
    ({"velocity_unit": "1 mm/s", "acceleration_unit": "1 mm/s^2"}, {}),
    (
        {"velocity_unit": "0.016666666667 mm/s", "acceleration_unit": "1 mm/s^2"},
        {VELOCITY: MILLIMETRES_PER_MINUTE},
    ),
    # a unit that the drive does not state, but the machine file does
    (
        {"velocity_unit": "3 um/s", "acceleration_unit": "7 um/s^2"},
        {VELOCITY: None, ACCELERATION: None},
    ),
]


# on a screw, by its lead: one revolution moves 3.6 um, so that 0.1 degrees move 1 nm
SCREW = [
    (
        {"lead": "3.6 um", "velocity_unit": "60 nm/s", "acceleration_unit": "60 nm/s^2"},
        {POSITION: TENTHS_OF_A_DEGREE, VELOCITY: 0x00B44700, ACCELERATION: RPM_PER_SECOND},
    ),
    (
        {"lead": "3.6 um", "velocity_unit": "3.6 um/s", "acceleration_unit": "1 um/s^2"},
        {VELOCITY: 0x00B40300, ACCELERATION: 0x02415700},
    ),
    # increments are of the encoder where the machine file says the same
    ({"velocity_unit": "10 nm/s", "acceleration_unit": "1 um/s^2"}, {VELOCITY: 0x01B50300}),
]


@pytest.mark.parametrize(
    ("units", "says"),
    RATES + SCREW,
    ids=["um/s", "mm/s", "mm/min", "machine file", "rpm, 0.1 deg", "turns/s", "counts"],
)
def test_moves_have_the_speed_asked_for(units, says, stage_machine):
    drives = Drives(with_units(stage_machine, **units), says)
    with drives.open() as stage:
        stage.boot()
        stage.check_move_to("x", 0.02, 1.0)
        stage.home()
        stage.enable()
        start = drives.world.now_ns
        stage.move_to("x", stage.targets[0] + 10e-3, velocity=0.02, acceleration=1.0)
        taken = (drives.world.now_ns - start) * 1e-9
        assert taken == pytest.approx(10e-3 / 0.02 + 0.02 / 1.0, abs=0.1)
        for axis, drive in zip(stage.axes, drives.stage.drives, strict=True):
            held_by(drive.dictionary.integer, axis.settings)


def held_by(integer, axis):
    """The drive holds the settings, in the units that it counts in."""
    for ref, value in (
        (od.QUICK_STOP_DECELERATION, axis.acceleration),
        (od.FOLLOWING_ERROR_WINDOW, axis.following_error),
        (od.FOLLOWING_ERROR_TIMEOUT, axis.following_error_time),
        (od.POSITION_WINDOW, axis.position_window),
        (od.MAX_FORCE, axis.peak_force),
        (od.SOFT_LIMIT_LOW, axis.travel[0]),
        (od.SOFT_LIMIT_HIGH, axis.travel[1]),
        (od.HOMING_SEARCH_SPEED, axis.homing_velocity[0]),
        (od.HOMING_INDEX_SPEED, axis.homing_velocity[1]),
        (od.HOMING_ACCELERATION, 1.0),
    ):
        held = integer(key(ref.index, ref.sub)) * unit(axis, ref)
        assert held == pytest.approx(value, abs=unit(axis, ref) / 2), str(ref)


def test_a_rotary_axis_counts_angles(stage_machine):
    text = stage_machine.text.replace("node: 1\n", "node: 1\n    rotary: true\n")
    drives = Drives(parse_machine(text, "rotary.yaml"), {})
    x, y = (d.dictionary.integer(VELOCITY) & 0xFFFFFFFF for d in drives.stage.drives)
    assert (x, y) == (0xF7100300, 0xF7010300)
    with drives.open() as stage:
        stage.boot()
        assert stage.limitations == ()


def test_whatever_is_written_has_a_quantity(stage_machine):
    """Boot, homing, and all modes: each object that reaches a drive stands in `drivers.objects`."""
    written = set()
    mapped = set()

    def see(time, can_id, data):
        if can_id & ~0x7F == 0x600 and data[0] >> 5 == 1:
            index, sub, value = struct.unpack_from("<HBI", data, 1)
            written.add((index, sub))
            if 0x1600 <= index < 0x1800 and sub:
                mapped.add(value >> 8)

    units = {"velocity_unit": "1 um/s", "acceleration_unit": "1 mm/s^2"}
    # no setting has its default, so that all of them are written
    changed = {"following_error": 2e-3, "travel": (-0.1, 0.1), "peak_force": 60.0}
    sync = {"sync_counter": 10, "sync_window": 0.5e-3}
    machine = with_units(stage_machine, **units)
    with open_stage(machine, tap=see, bus=sync, **changed)[0] as stage:
        power_up(stage)
        stage.hold(0.02)
        stage.move_to("x", stage.targets[0] + 1e-3, velocity=0.05, acceleration=1.0)
        with stage.profile_moves(velocity=0.04, acceleration=0.9) as moves:
            moves.to("y", 1e-3, relative=True)
        stage.stream_velocity(np.zeros((20, 2)))
        stage.stream_force(np.zeros((5, 2)))
        stage.enable()
        stage.halt()
        stage.quick_stop()
    known = {
        (ref.index, ref.sub)
        for ref in vars(od).values()
        if isinstance(ref, ObjectRef) and ref.quantity is not None
    }
    pdo_setup = {place for place in written if 0x1400 <= place[0] < 0x1C00}
    assert written - pdo_setup <= known
    assert {divmod(entry, 0x100) for entry in mapped} <= known
    assert len(written - pdo_setup) > 12
    assert {entry >> 8 for entry in mapped} == {0x6040, 0x607A, 0x60B2, 0x60FF, 0x6071}
