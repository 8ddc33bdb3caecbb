"""Each kind of fault on the bus of a plant that follows its demand exactly."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Iterator

import can
import pytest

from hil_sim.bus import FaultyWorld
from hil_sim.bus import faults as f
from hil_sim.cia402 import State
from hil_sim.stage import VirtualStage

_names = (f"faults-{n}" for n in itertools.count())
MS = 1_000_000
TPDO_X = f.Frames(frozenset({0x181}), "drives")
SYNC = f.Frames(frozenset({0x080}), "host")


class Bench:
    """A host on a bus with a plan of faults; both drives enabled in csp by `enable`."""

    def __init__(self, make_host, settings, plant, plan, extra=()):
        self.plant = plant
        self.world = FaultyWorld(next(_names), plan)
        self.stage = VirtualStage(settings, seed=1, plant=plant)
        self.world.power_on(self.stage)
        self.bus = can.Bus(interface="lockstep", channel=self.world.name)
        self.host = make_host(self.bus)
        self.host.wait(30)

    @property
    def counts(self):
        return [entry.count for entry in self.world.injected]

    def enable(self):
        self.host.nmt(1)
        for node in (1, 2):
            self.host.enable(8, node)

    def cycle(self, count=1):
        """SYNCs without setpoints; the TPDOs of both drives as they came, by cycle."""
        got = []
        for _ in range(count):
            self.host.take(0x181), self.host.take(0x182)
            self.host.send(0x080)
            got.append((self.host.take(0x181), self.host.take(0x182)))
            self.host.wait(1)
        return got


@pytest.fixture
def bench(make_host, stage_settings, plant) -> Iterator[Callable[..., Bench]]:
    made = []

    def make(*faults: f.Fault, seed: int = 0) -> Bench:
        made.append(Bench(make_host, stage_settings, plant, f.FaultPlan(faults, seed)))
        return made[-1]

    yield make
    for one in made:
        one.bus.shutdown()


def frames(frames: f.Frames, **changes) -> f.Frames:
    from dataclasses import replace

    return replace(frames, **changes)


# Frames --------------------------------------------------------------------------------------


def test_a_dropped_frame_is_the_only_one_missing(bench):
    b = bench(f.Drop(frames(TPDO_X, nth=frozenset({3, 5}))))
    b.enable()
    got = b.cycle(7)
    assert [len(x) for x, _ in got] == [1, 1, 0, 1, 0, 1, 1]
    assert all(len(y) == 1 for _, y in got)
    assert b.counts == [2]


def test_a_window_counts_from_its_beginning(bench):
    b = bench(f.Drop(frames(TPDO_X, after=0.0, until=1.0, nth=frozenset({1}))))
    late = bench(f.Drop(frames(TPDO_X, after=1.0)))
    for one, lost in ((b, [0, 1]), (late, [1, 1])):
        one.enable()
        assert [len(x) for x, _ in one.cycle(2)] == lost
    late.host.wait(1000)
    assert [len(x) for x, _ in late.cycle(2)] == [0, 0]


def test_probability_is_drawn_from_the_seed(bench):
    def lost(seed, *more):
        b = bench(f.Drop(frames(TPDO_X, probability=0.3)), *more, seed=seed)
        b.enable()
        return [len(x) for x, _ in b.cycle(200)]

    assert 0.2 < lost(1).count(0) / 200 < 0.4
    assert lost(1) == lost(1)
    assert lost(1) != lost(2)
    # another fault with draws of its own changes nothing
    other = f.Drop(f.Frames(frozenset({0x182}), "drives", probability=0.5))
    assert lost(1) == lost(1, other)


def test_at_most(bench):
    b = bench(f.Drop(frames(TPDO_X, at_most=2)))
    b.enable()
    assert [len(x) for x, _ in b.cycle(4)] == [0, 0, 1, 1]


def test_a_frame_of_the_host_missed_by_one_drive_only(bench):
    b = bench(f.Drop(frames(SYNC, node=2)))
    b.enable()
    assert [(len(x), len(y)) for x, y in b.cycle(3)] == [(1, 0)] * 3


def test_a_lost_setpoint_is_not_taken_over(bench, plant):
    b = bench(f.Drop(f.Frames(frozenset({0x201}), "host", nth=frozenset({2}))))
    b.enable()
    start = b.host.read_object(1, 0x6064, 0, "i")
    demands = []
    for step in (1000, 2000, 3000):
        b.host.cycle(start + step)
        demands.append(round(plant.demand(0) * 1e9) - round(plant.actual[0] * 1e9))
    targets = [round(p * 1e9) for _, axis, p, _, _ in plant.commands if axis == 0][-3:]
    assert targets[1] - targets[0] == 0
    assert targets[2] - targets[1] == 2000


def test_duplicates_come_at_once(bench):
    b = bench(f.Duplicate(frames(TPDO_X, nth=frozenset({2})), copies=2))
    b.enable()
    got = b.cycle(3)
    assert [len(x) for x, _ in got] == [1, 3, 1]
    assert len({(x.time_ns, x.data) for x in got[1][0]}) == 1


def test_a_delayed_frame_comes_later_by_what_was_drawn(bench):
    b = bench(f.Delay(TPDO_X, 1e-4, 3e-4), seed=4)
    b.enable()
    late = []
    for _ in range(50):
        sent = b.world.now_ns
        b.host.send(0x080)
        assert b.host.take(0x181) == []
        b.host.wait(1)
        (frame,) = b.host.take(0x181)
        late.append(frame.time_ns - sent)
    assert 100_000 <= min(late) < 130_000
    assert 270_000 < max(late) <= 300_000


def test_jitter_of_the_sync_reaches_all_drives_alike(bench):
    b = bench(f.Delay(SYNC, 2e-4, 2e-4))
    b.enable()
    sent = b.world.now_ns
    b.host.send(0x080)
    b.host.wait(1)
    times = {b.host.take(0x180 + node)[-1].time_ns for node in (1, 2)}
    assert times == {sent + 200_000}


def test_a_reordered_frame_comes_after_the_next(bench):
    b = bench(f.Reorder(frames(TPDO_X, nth=frozenset({2}))))
    b.enable()
    order = []
    for _ in range(3):
        b.host.frames.clear()
        b.host.send(0x080)
        order.append([x.can_id for x in b.host.frames])
        b.host.wait(1)
    assert order == [[0x181, 0x182], [0x182, 0x181], [0x181, 0x182]]


def test_a_reordered_frame_that_nothing_follows_comes_after_hold(bench):
    b = bench(f.Reorder(f.Frames(frozenset({0x182}), "drives", nth=frozenset({1})), hold=5e-4))
    b.enable()
    sent = b.world.now_ns
    b.host.send(0x080)
    b.host.wait(1)
    assert [x.time_ns - sent for x in b.host.take(0x182)] == [500_000]


@pytest.mark.parametrize("length", [0, 3, 8])
def test_length(bench, length):
    b = bench(f.Resize(frames(TPDO_X, nth=frozenset({2})), length))
    b.enable()
    b.cycle(1)
    (bad,) = b.cycle(1)[0][0]
    (good,) = b.cycle(1)[0][0]
    assert len(good.data) == 8
    assert bad.data == good.data[:length]


def test_a_setpoint_of_the_wrong_length_is_refused_by_the_drive(bench):
    b = bench(f.Resize(f.Frames(frozenset({0x201}), "host"), 3))
    b.enable()
    b.host.take(0x081)
    b.host.send(0x201, struct.pack("<Hih", 0x0F, 0, 0))
    assert [x.data[:2] for x in b.host.take(0x081)] == [struct.pack("<H", 0x8210)]
    b.cycle(1)
    assert b.stage.drives[0].motion.state is State.ENABLED


def test_a_frozen_tpdo_repeats_what_was_before(bench):
    b = bench(f.Freeze(frames(TPDO_X, after=1.0)))
    b.enable()
    start = b.host.read_object(1, 0x6064, 0, "i")
    before = b.host.cycle(start)
    b.host.wait(1000)
    after = [b.host.cycle(start + 1000 * k) for k in (1, 2, 3)]
    assert after == [before] * 3
    assert b.host.read_object(1, 0x6064, 0, "i") > start + 1000


def test_heartbeat_silence(bench):
    b = bench(f.Drop(f.Frames(frozenset({0x701}), after=0.5)))
    b.host.write(1, 0x1017, 0, "H", 100)
    b.host.take(0x701)
    b.host.wait(1000)
    times = [x.time_ns for x in b.host.take(0x701)]
    assert len(times) >= 4
    assert max(times) < 500 * MS


def test_heartbeat_of_the_host_lost_stops_the_drive(bench):
    b = bench(f.Drop(f.Frames(frozenset({0x77F}), "host", after=0.5)))
    b.enable()
    for node in (1, 2):
        b.host.write(node, 0x1016, 1, "I", 127 << 16 | 200)
    while b.world.now_ns < 700 * MS:
        b.host.send(0x77F, b"\x05")
        b.cycle(10)
    b.host.wait(100)
    assert all(d.motion.state is not State.ENABLED for d in b.stage.drives)


# SDO -----------------------------------------------------------------------------------------


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


def test_a_cause_that_stays_refuses_resets_and_outlives_a_reboot(bench):
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


# Plans ---------------------------------------------------------------------------------------


def test_without_a_fault_that_strikes_all_is_as_without_faults(
    make_host, stage_settings, make_following_plant, bench
):
    def trace(world):
        with can.Bus(interface="lockstep", channel=world.name) as bus:
            host = make_host(bus)
            host.wait(30)
            host.nmt(1)
            for node in (1, 2):
                host.enable(8, node)
            for k in range(20):
                host.cycle(1000 * k, node=1 + k % 2)
            return host.frames

    from hil_sim.bus import World

    plain = World(next(_names))
    VirtualStage(stage_settings, seed=1, plant=make_following_plant()).attach(plain)
    never = f.FaultPlan((f.Drop(f.Frames(after=1e6)), f.Reboot(1, 1e6), f.SdoAbort(1, 9999)))
    faulty = FaultyWorld(next(_names), never)
    faulty.power_on(VirtualStage(stage_settings, seed=1, plant=make_following_plant()))
    assert trace(plain) == trace(faulty)


def test_a_node_that_is_not_there_is_refused(stage_settings, plant):
    world = FaultyWorld(next(_names), f.FaultPlan((f.Reboot(9, 1.0),)))
    with pytest.raises(ValueError, match="no node 9"):
        world.power_on(VirtualStage(stage_settings, seed=1, plant=plant))


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: f.Frames(probability=0.0), "probability"),
        (lambda: f.Frames(after=2.0, until=1.0), "until"),
        (lambda: f.Frames(after=math.nan), "after"),
        (lambda: f.Frames(node=1), "sender"),
        (lambda: f.Frames(nth=frozenset({0})), "nth"),
        (lambda: f.Resize(TPDO_X, 9), "length"),
        (lambda: f.Delay(TPDO_X, 2.0, 1.0), "most"),
        (lambda: f.DriveFault(1, 0x8611), "either"),
        (lambda: f.DriveFault(1, 0, at=1.0), "code"),
        (lambda: f.BusOff(1, 1.0, 0.0), "duration"),
    ],
)
def test_impossible_faults_are_refused_when_made(make, word):
    with pytest.raises(ValueError, match=word):
        make()
