"""Stopping a stage that is only partly reached: faults on the bus, in virtual time."""

import numpy as np
import pytest

from drivers.commissioning import status_of
from drivers.errors import AxisFault, BusError
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from tests.lockstep import open_stage, power_up

RPDO_Y = f.Frames(frozenset({0x202}), "host", after=1.0)
SYNC = f.Frames(frozenset({0x080}), "host", after=1.0)


class Bench:
    """A stage enabled on a faulty bus; its faults begin at 1 s."""

    def __init__(self, machine, *faults):
        self.stage, self.drives, self.world = open_stage(machine, *faults, start=(-5e-4, -4e-4))
        power_up(self.stage)
        self.stage.idle(0.99 - self.now)
        self.stage.enable()  # takes the cycle up again

    @property
    def now(self):
        return self.world.now_ns * 1e-9

    @property
    def enabled(self):
        return [d.node_id for d in self.drives.drives if d.motion.state is State.ENABLED]

    def hold(self, count):
        rows = np.tile(np.array(self.stage.targets), (count, 1))
        return self.stage.stream(rows, np.zeros_like(rows))

    def enabled_until(self, node):
        """Lets the stage rest for 0.2 s after its end; when the drive was last seen enabled [s]."""
        last = self.now if node in self.enabled else 0.0
        self.world.sleep_until_ns(self.world.now_ns + 200_000_000)
        return self.now if node in self.enabled else last


@pytest.fixture
def bench(stage_machine):
    made = []

    def make(*faults):
        made.append(Bench(stage_machine, *faults))
        return made[-1]

    yield make
    for one in made:
        one.stage.close()


def test_a_drive_that_gets_no_setpoints_is_switched_off_by_sdo(bench):
    b = bench(f.Drop(RPDO_Y))
    b.hold(100)
    b.stage.disable()
    assert b.enabled == []


def test_a_drive_that_gets_no_setpoints_is_stopped_by_sdo_within_50_ms(bench):
    b = bench(f.Drop(RPDO_Y), f.DriveFault(1, 0x2310, at=1.1))
    seen = []

    def look():
        seen.extend((b.now, node) for node in b.enabled)
        b.world.at(b.world.now_ns + 1_000_000, look)

    look()
    with pytest.raises(AxisFault, match=r"^axis x: .*0x2310"):
        b.hold(500)
    assert max(t for t, node in seen if node == 2) < 1.1 + 0.05
    assert b.enabled == []


def test_without_sync_all_drives_are_stopped_by_sdo(bench):
    b = bench(f.Drop(SYNC))
    with pytest.raises(AxisFault, match=r"no process data \(TPDO 0x181\) for 6 SYNCs in a row"):
        b.hold(500)
    assert b.enabled == []


@pytest.mark.parametrize("duration", [0.03, 0.3, 5.0])
def test_a_drive_that_cannot_be_reached_for_a_while_ends_stopped(bench, duration):
    b = bench(f.BusOff(2, at=1.1, duration=duration))
    with pytest.raises(AxisFault, match=r"^axis y: "):
        b.hold(500)
    b.stage.close()
    b.world.sleep_until_ns(b.world.now_ns + 600_000_000)
    assert b.enabled == []


def test_when_the_host_is_bus_off_the_drives_stop_by_themselves(bench):
    b = bench(f.BusOff(None, at=1.1, duration=0.05))
    with pytest.raises(BusError, match="bus-off"):
        b.hold(500)
    b.stage.close()
    assert b.enabled_until(1) < 2.0
    b.world.sleep_until_ns(b.world.now_ns + 600_000_000)
    assert b.enabled == []


def test_after_a_bus_off_the_host_stops_drives_that_never_heard_its_heartbeat(bench):
    heartbeat = f.Frames(frozenset({0x77F}), "host")  # a consumer's watch begins with the first
    b = bench(f.Drop(heartbeat), f.BusOff(None, at=1.1, duration=0.05))
    with pytest.raises(BusError, match="bus-off"):
        b.hold(500)
    assert b.enabled == []  # the stop has waited for the bus
    assert 1.15 < b.now < 1.3
    b.stage.close()


def test_a_drive_that_answers_nothing_is_not_confirmed_off(bench):
    sdo = f.Frames(frozenset({0x582}), "drives", after=1.0)
    b = bench(f.Drop(RPDO_Y), f.Drop(sdo))
    b.hold(100)
    with pytest.raises(
        AxisFault, match=r"^axis y: 0x6041:00 statusword: was commanded to switch off"
    ):
        b.stage.disable()
    b.stage.close()
    b.world.sleep_until_ns(b.world.now_ns + 600_000_000)
    assert b.enabled == []


def test_a_drive_that_hears_only_the_heartbeat_is_made_to_miss_it(bench):
    b = bench(f.Freeze(f.Frames(frozenset({0x202, 0x602}), "host", after=1.0)))
    b.hold(100)
    b.stage.safe_stop()
    assert b.enabled == []


def test_safe_torque_off_stops_both_and_is_named(bench):
    b = bench(f.SafeTorqueOff(2, at=1.1, until=6.0))
    with pytest.raises(AxisFault, match=r"^axis y: .*STO.*0x60FD:00 .*interlock") as caught:
        b.hold(500)
    assert b.enabled == []
    assert "last commands: " in str(caught.value)
    assert "interlock active (STO" in status_of(b.stage.axes[1]).words
    with pytest.raises(AxisFault, match=r"^axis y: .*STO"):
        b.stage.enable()
    b.stage.idle(6.1 - b.now)
    b.stage.enable()
    assert b.stage.hold(0.01).valid.all()
    assert "interlock" not in status_of(b.stage.axes[1]).words


def test_drives_that_all_fall_silent_are_stopped_without_a_long_wait(bench):
    stage = bench(*(f.BusOff(at=1.0, duration=600.0, node=n) for n in (1, 2)))
    received = []
    stage.world.subscribe(0x601, lambda data: received.append(bytes(data)))
    with pytest.raises(AxisFault, match=r"axis x: .*no process data .*nor from the other axes"):
        stage.hold(500)
    stage.stage.close()
    assert stage.now < 1.0 + 5.0  # two nodes, each asked once in earnest
    assert bytes.fromhex("2b40600000000000") in received  # disable voltage: it may still listen
    assert stage.enabled == []
