"""Units other than 1 nm, homing that cannot end, drives left in a fault."""

import itertools

import numpy as np
import pytest

from drivers.errors import AxisFault, HomingError
from hil_sim.bus import faults as f
from stagectl.config.machine.file import parse_machine
from tests.lockstep import open_on, open_stage, power_up, switch_on

_names = (f"units-{n}" for n in itertools.count())
TPDO_X = frozenset({0x181})


START = (-5e-3, -4e-3)


def opened(machine, *faults, **settings):
    """A stage that homes as the machine file says, its drives and their bus."""
    return open_stage(machine, *faults, start=START, homing_method=None, **settings)


def homes_and_goes_a_millimetre(stage):
    """Whatever the units on the bus are, the stage's are metres."""
    power_up(stage)
    assert max(map(abs, stage.positions)) < 1e-6
    start = np.array(stage.targets)
    ramp = start + np.linspace(0, 1e-3, 200)[:, None]
    stage.stream(ramp, np.zeros_like(ramp))
    rest = stage.hold(0.3)
    np.testing.assert_allclose(rest.position[-1], ramp[-1], atol=50e-9)


@pytest.mark.parametrize("increment", ["5 nm", "0.5 nm", "4.8828125 nm"])
def test_encoder_increments_other_than_1_nm(stage_machine, increment):
    text = stage_machine.text.replace("increment: 1.0e-9", f"increment: {increment}")
    with opened(parse_machine(text, "other.yaml"))[0] as stage:
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
    with opened(parse_machine(text, "other.yaml"))[0] as stage:
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


def test_a_frozen_tpdo_ends_homing_soon_and_is_named(stage_machine):
    frozen = f.Freeze(f.Frames(TPDO_X, "drives", after=0.8))
    stage, _, world = opened(stage_machine, frozen)
    with stage:
        stage.boot()
        before = world.now_ns
        with pytest.raises(
            HomingError, match=r"^axis x: .*0x181.* have not changed .*TPDO is frozen"
        ):
            stage.home()
        assert world.now_ns - before < 6e9
        assert not stage.homed


def test_an_earlier_homing_in_frozen_data_is_not_accepted(stage_machine):
    frozen = f.Freeze(f.Frames(TPDO_X, "drives", after=4.0))
    stage, _, world = opened(stage_machine, frozen)
    with stage:
        power_up(stage)
        stage.hold(0.1)
        stage.home(force=True)
        stage.idle(max(0.0, 4.1 - world.now_ns * 1e-9))
        with pytest.raises(AxisFault, match=r"^axis x: "):
            stage.home(force=True)


def test_a_fault_of_an_earlier_session_says_how_to_reset_it(stage_machine):
    drives, world = switch_on(stage_machine)
    with open_on(world, stage_machine) as stage:
        power_up(stage)
        drives.drives[1].inject_fault(0x2310)
        with pytest.raises(AxisFault):
            stage.hold(0.1)
    with open_on(world, stage_machine) as stage:
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
