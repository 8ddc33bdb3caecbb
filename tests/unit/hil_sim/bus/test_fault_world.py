"""Faults of nodes: SDO aborts, bus-off, reboots, faults of drives; one node's transceiver."""

import struct

import can
import pytest

from hil_sim.bus import FaultyWorld
from hil_sim.bus import faults as f
from hil_sim.bus.fault_world import Transceiver
from hil_sim.cia402 import State
from hil_sim.stage import VirtualStage

MS = 1_000_000


def test_the_nth_access_is_aborted_and_never_seen_by_the_node(bench):
    b = bench(f.SdoAbort(1, nth=2, code=0x06040043, index=0x6060))
    b.host.write(1, 0x6083, 0, "I", 5)
    b.host.write(1, 0x6060, 0, "b", 1)
    code = b.host.refusal(lambda: b.host.write(1, 0x6060, 0, "b", 8))
    assert code == 0x06040043
    assert b.host.read_object(1, 0x6060, 0, "b") == 1
    assert b.host.read_object(2, 0x6060, 0, "b") == 0
    b.host.write(1, 0x6060, 0, "b", 8)
    assert b.counts == [1]


def test_segments_are_not_counted_as_accesses(bench):
    b = bench(f.SdoAbort(1, nth=2))
    assert len(b.host.upload(1, 0x1008, 0)) > 4
    assert b.host.refusal(lambda: b.host.read_object(1, 0x6041, 0, "H")) == f.GENERAL_ABORT


# Drives --------------------------------------------------------------------------------------


def test_bus_off_and_return(bench):
    b = bench(f.BusOff(1, at=0.5, duration=0.1))
    b.enable()
    b.host.write(1, 0x1017, 0, "H", 10)
    b.host.wait(500 - b.world.now_ns / MS + 1)
    b.host.take(0x701)
    assert [(len(x), len(y)) for x, y in b.cycle(20)] == [(0, 1)] * 20
    b.host.send(0x601, struct.pack("<BHB4x", 0x40, 0x6041, 0))
    b.host.wait(50)
    assert b.host.take(0x701) == b.host.take(0x581) == []
    b.host.wait(50)
    assert [x.data[:2] for x in b.host.take(0x081)] == [struct.pack("<H", 0x8140)]
    assert [(len(x), len(y)) for x, y in b.cycle(2)] == [(1, 1)] * 2
    assert b.host.take(0x701)


def test_the_host_bus_off_cannot_send_and_hears_nothing(bench):
    b = bench(f.BusOff(None, at=0.5, duration=0.1))
    b.host.write(1, 0x1017, 0, "H", 10)
    b.host.wait(500 - b.world.now_ns / MS + 1)
    b.host.take(0x701)
    with pytest.raises(can.CanOperationError, match="bus-off"):
        b.host.send(0x080)
    b.host.wait(90)
    assert b.host.take(0x701) == []
    b.host.wait(20)
    assert b.host.take(0x701)
    b.host.send(0x080)


def test_reboot_of_one_node(bench):
    b = bench(f.Reboot(2, at=0.5))
    b.enable()
    b.host.take(0x701), b.host.take(0x702)
    b.host.wait(500 - b.world.now_ns / MS + 1)
    assert b.stage.drives[1].motion.state is State.SWITCH_ON_DISABLED
    assert not b.plant.powered[1]
    assert b.stage.drives[0].motion.state is State.ENABLED
    b.host.wait(30)
    assert [x.data for x in b.host.take(0x702)] == [b"\x00"]
    assert b.host.take(0x701) == []
    assert [(len(x), len(y)) for x, y in b.cycle(1)] == [(1, 0)]


@pytest.mark.parametrize("error", f.DRIVE_FAULTS)
def test_drive_faults_at_a_time(bench, error):
    code = f.DRIVE_FAULTS[error]
    b = bench(f.DriveFault(1, code, at=0.5))
    b.enable()
    b.host.wait(499.5 - b.world.now_ns / MS)
    assert b.stage.drives[0].motion.state is State.ENABLED
    b.host.wait(20)
    assert b.stage.drives[0].motion.state is State.FAULT
    assert b.stage.drives[1].motion.state is State.ENABLED
    assert b.host.read_object(1, 0x603F, 0, "H") == code
    assert [x.data[:2] for x in b.host.take(0x081)] == [struct.pack("<H", code)]


def test_a_lasting_fault_refuses_resets_and_outlives_a_reboot(bench):
    b = bench(f.DriveFault(1, 0x3220, at=0.5, until=0.8), f.Reboot(1, 0.7))
    b.enable()
    b.host.wait(520 - b.world.now_ns / MS)

    def reset():
        for word in (0x00, 0x80):
            b.host.write(1, 0x6040, 0, "H", word)
        return b.stage.drives[0].motion.state

    assert reset() is State.FAULT
    assert not b.host.read_object(1, 0x6041, 0, "H") & 0x0010  # no supply
    b.host.take(0x081)
    b.host.wait(740 - b.world.now_ns / MS)  # booted anew
    assert [x.data[:2] for x in b.host.take(0x081)] == [b"\x20\x32"]
    assert reset() is State.FAULT
    b.host.wait(801 - b.world.now_ns / MS)
    assert b.stage.drives[0].motion.state is State.FAULT  # the fault stays, its cause is gone
    assert reset() is State.SWITCH_ON_DISABLED
    assert b.host.read_object(1, 0x603F, 0, "H") == 0
    assert b.host.read_object(1, 0x6041, 0, "H") & 0x0010


def test_a_drive_fault_in_place_strikes_once_where_the_axis_passes(bench):
    b = bench(f.DriveFault(1, 0x8612, position=50e-6))
    b.enable()
    target = b.host.read_object(1, 0x6064, 0, "i")
    assert abs(target) < 10_000
    while b.stage.drives[0].motion.state is State.ENABLED and target < 80_000:
        target += 1000
        b.host.cycle(target)
    assert b.counts == [1]
    assert 50_000 <= b.host.read_object(1, 0x6064, 0, "i") <= 53_000


def test_a_fault_of_an_unknown_node_is_refused(stage_settings, plant, name):
    world = FaultyWorld(name, f.FaultPlan((f.Reboot(9, 1.0),)))
    with pytest.raises(ValueError, match="no node 9"):
        world.power_on(VirtualStage(stage_settings, seed=1, plant=plant))


# Transceivers ---------------------------------------------------------------------------------


@pytest.fixture
def sent():
    return []


@pytest.fixture
def node(bus, sent):
    return Transceiver(bus.world, 1, lambda can_id, data: sent.append((can_id, data)), None)


def send(bus, data):
    bus.send(can.Message(arbitration_id=0x201, data=data, is_extended_id=False))
    bus.recv(0)


def test_after_unsubscribing_and_subscribing_again_a_frame_comes_once(bus, node):
    heard = []
    node.subscribe(0x201, heard.append)
    node.unsubscribe(0x201, heard.append)
    send(bus, b"\x01")
    assert heard == []
    node.subscribe(0x201, heard.append)
    send(bus, b"\x02")
    assert heard == [b"\x02"]


def test_bus_off_neither_sends_nor_receives_but_its_timers_go_on(bus, node, sent):
    heard, ticks = [], []
    node.subscribe(0x201, heard.append)
    node.at(node.now_ns + 1000, lambda: ticks.append(node.now_ns))
    node.bus_off = True
    node.emit(0x181, b"\x01")
    send(bus, b"\x02")
    bus.clock.sleep_until_ns(2000)
    assert (sent, heard, ticks) == ([], [], [1000])
    node.deliver(0x201, b"\x05")  # one that the line has held back
    node.bus_off = False
    node.emit(0x181, b"\x03")
    send(bus, b"\x04")
    assert (sent, heard) == ([(0x181, b"\x03")], [b"\x05", b"\x04"])
