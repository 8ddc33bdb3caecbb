"""What a stage server needs of a stage: watching without power, interrupting, changing the tap."""

import numpy as np
import pytest

from drivers.errors import AxisFault
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from stagectl.errors import Aborted
from tests.lockstep import open_on, power_up, switch_on


@pytest.fixture
def switched_on(stage_machine):
    return switch_on(stage_machine)


@pytest.fixture
def stage(stage_machine, switched_on):
    with open_on(switched_on[1], stage_machine) as stage:
        yield stage


def test_without_power_positions_are_seen_and_nothing_is_enabled(stage, switched_on):
    stage.boot()
    assert stage.statuswords == (None, None)
    stage.watch(0.02)
    assert None not in stage.statuswords
    assert not stage.enabled
    assert any(stage.positions)


def test_a_restarted_drive_is_noticed_while_watching_unless_that_is_known(stage_machine):
    _, world = switch_on(stage_machine, f.Reboot(2, 2.0))
    with open_on(world, stage_machine) as stage:
        stage.boot()
        with pytest.raises(AxisFault, match="axis y"):
            stage.watch(5.0)
        stage.watch(0.02, checked=False)


def still(stage):
    return np.tile(stage.targets, (2000, 1))


@pytest.mark.parametrize(
    "method",
    [
        lambda stage: stage.stream(still(stage), 0 * still(stage)),
        lambda stage: [stage.home(force=True) for _ in range(100)],
        lambda stage: stage.watch(1.0),
    ],
    ids=["stream", "home", "watch"],
)
def test_what_interrupt_raises_ends_any_method_and_stops_the_axes(stage, switched_on, method):
    power_up(stage)
    calls = []

    def interrupt():
        calls.append(stage.clock.now_ns())
        if len(calls) == 3:
            raise Aborted("stopped by anna")

    stage.interrupt = interrupt
    with pytest.raises(Aborted, match="anna"):
        method(stage)
    assert np.diff(calls[:3]).max() <= 30_000_000
    assert all(d.motion.state is not State.ENABLED for d in switched_on[0].drives)


def test_the_tap_can_be_changed_between_streams(stage):
    power_up(stage)
    rows = np.tile(stage.targets, (20, 1))
    seen = []
    stage.tap = lambda t, can_id, data: seen.append(can_id)
    stage.stream(rows, np.zeros_like(rows))
    stage.tap = None
    count = len(seen)
    stage.stream(rows, np.zeros_like(rows))
    assert len(seen) == count
    assert seen.count(0x80) == 20
    assert {0x201, 0x202, 0x181, 0x182} <= set(seen)
