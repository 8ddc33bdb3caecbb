"""Units other than 1 nm, homing that cannot end, drives left in a fault."""

import dataclasses
import itertools

import numpy as np
import pytest

from drivers.errors import AxisFault, ConfigurationError, HomingError
from drivers.stage import Stage
from hil_sim.bus import FaultyWorld
from hil_sim.bus import faults as f
from hil_sim.stage import VirtualStage
from stagectl.config.machine.file import parse_machine
from stagectl.config.settings.package_settings import driver_settings, stage_settings

_names = (f"units-{n}" for n in itertools.count())
TPDO_X = frozenset({0x181})


class Bench:
    """A stage that is booted, on a faulty world; its virtual drives keep their state."""

    def __init__(self, machine, *faults):
        self.world = FaultyWorld(next(_names), f.FaultPlan(faults))
        self.drives = VirtualStage(stage_settings(machine), seed=1, start=(-5e-3, -4e-3))
        self.world.power_on(self.drives)
        self.machine = machine

    def open(self, **changes):
        bus, axes = driver_settings(self.machine)
        bus = dataclasses.replace(bus, interface="lockstep", channel=self.world.name)
        return Stage.open(bus, [dataclasses.replace(a, **changes) for a in axes])


def homes_and_goes_a_millimetre(stage):
    """Whatever the units on the bus are, the stage's are metres."""
    stage.boot()
    stage.home()
    stage.enable()
    assert max(map(abs, stage.positions)) < 1e-6
    start = np.array(stage.targets)
    ramp = start + np.linspace(0, 1e-3, 200)[:, None]
    stage.stream(ramp, np.zeros_like(ramp))
    rest = stage.hold(0.3)
    np.testing.assert_allclose(rest.position[-1], ramp[-1], atol=50e-9)


@pytest.mark.parametrize("increment", ["5 nm", "0.5 nm", "4.8828125 nm"])
def test_encoder_increments_other_than_1_nm(stage_machine, increment):
    text = stage_machine.text.replace("increment: 1.0e-9", f"increment: {increment}")
    bench = Bench(parse_machine(text, "other.yaml"))
    with bench.open() as stage:
        homes_and_goes_a_millimetre(stage)


UNITS = [
    "position_unit: 5 nm\n      velocity_unit: 5 nm/s",
    "position_unit: 0.5 nm\n      velocity_unit: 0.5 nm/s",
    "position_unit: 4.8828125 nm\n      velocity_unit: 4.8828125 nm/s",
    "position_unit: 10 nm\n      velocity_unit: 1 um/s\n      acceleration_unit: 1 mm/s^2",
]


@pytest.mark.parametrize("units", UNITS)
def test_drives_with_other_units(stage_machine, units):
    text = stage_machine.text
    for rated in ("rated_force: 40.0", "rated_force: 60.0"):
        text = text.replace(rated, f"{units}\n      {rated}")
    bench = Bench(parse_machine(text, "other.yaml"))
    with bench.open() as stage:
        homes_and_goes_a_millimetre(stage)
        stage.move_to("x", 2e-3, velocity=0.02, acceleration=0.5)
        assert stage.positions[0] == pytest.approx(2e-3, abs=1.1e-6)
        before = stage.positions[0]
        speed = np.full((200, 2), 0.0)
        speed[:100, 0] = np.linspace(0.0, 5e-3, 100)
        speed[100:, 0] = np.linspace(5e-3, 0.0, 100)
        stage.stream_velocity(speed)
        stage.enable()
        stage.hold(0.2)
        assert stage.positions[0] - before == pytest.approx(speed[:, 0].sum() * 1e-3, abs=2e-6)


def test_a_wrong_unit_in_the_machine_file_is_named(stage_machine):
    machine = stage_machine.text.replace(
        "rated_force: 40.0", "position_unit: 2 nm\n      rated_force: 40.0"
    )
    drives = Bench(stage_machine)
    drives.machine = parse_machine(machine, "wrong.yaml")
    with (
        drives.open() as stage,
        pytest.raises(
            ConfigurationError, match=r"^axis x: 0x6092:01 .*which is 1e-09 m; .* 2e-09 m"
        ),
    ):
        stage.boot()


def test_a_frozen_tpdo_ends_homing_soon_and_is_named(stage_machine):
    bench = Bench(stage_machine, f.Freeze(f.Frames(TPDO_X, "drives", after=0.8)))
    with bench.open() as stage:
        stage.boot()
        before = bench.world.now_ns
        with pytest.raises(
            HomingError, match=r"^axis x: .*0x181.* have not changed .*TPDO is frozen"
        ):
            stage.home()
        assert bench.world.now_ns - before < 6e9
        assert not stage.homed


def test_an_earlier_homing_in_frozen_data_is_not_accepted(stage_machine):
    bench = Bench(stage_machine, f.Freeze(f.Frames(TPDO_X, "drives", after=4.0)))
    with bench.open() as stage:
        stage.boot()
        stage.home()
        stage.enable()
        stage.hold(0.1)
        stage.home(force=True)
        stage.idle(max(0.0, 4.1 - bench.world.now_ns * 1e-9))
        with pytest.raises(AxisFault, match=r"^axis x: "):
            stage.home(force=True)


def test_a_fault_of_an_earlier_session_says_how_to_reset_it(stage_machine):
    bench = Bench(stage_machine)
    with bench.open(homing_method=37) as stage:
        stage.boot()
        stage.home()
        stage.enable()
        bench.drives.drives[1].inject_fault(0x2310)
        with pytest.raises(AxisFault):
            stage.hold(0.1)
    with bench.open(homing_method=37) as stage:
        stage.boot()
        with pytest.raises(AxisFault) as caught:
            stage.home()
        text = str(caught.value)
        assert text.startswith("axis y: 0x6041:00 statusword: is in fault, to be reset first")
        assert "(stagectl enable --reset)" in text
        assert "continuous over-current (output) (0x2310)" in text
        stage.reset_faults()
        stage.home()
        stage.enable()
        assert stage.enabled
