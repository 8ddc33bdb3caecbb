"""Faults of frames, on the bus of a plant that follows its demand exactly."""

from dataclasses import replace

import pytest

from hil_sim.bus import faults as f

MS = 1_000_000
TPDO_X = f.Frames(frozenset({0x181}), "drives")
SYNC = f.Frames(frozenset({0x080}), "host")


def of_x(**which):
    return replace(TPDO_X, **which)


@pytest.mark.parametrize(
    ("fault", "x", "y"),
    [
        (f.Drop(of_x(nth=frozenset({3, 5}))), [1, 1, 0, 1, 0, 1, 1], [1] * 7),
        (f.Drop(of_x(at_most=2)), [0, 0, 1, 1], [1] * 4),
        # a window counts from its beginning
        (f.Drop(of_x(after=0.0, until=1.0, nth=frozenset({1}))), [0, 1], [1, 1]),
        # one of the host that one drive alone misses
        (f.Drop(replace(SYNC, node=2)), [1] * 3, [0] * 3),
    ],
)
def test_dropped_frames_are_the_only_ones_missing(bench, fault, x, y):
    b = bench(fault)
    b.enable()
    got = b.cycle(len(x))
    assert [len(frames) for frames, _ in got] == x
    assert [len(frames) for _, frames in got] == y
    assert b.counts == [x.count(0) + y.count(0)]


def test_a_window_may_begin_later(bench):
    b = bench(f.Drop(of_x(after=1.0)))
    b.enable()
    assert [len(x) for x, _ in b.cycle(2)] == [1, 1]
    b.host.wait(1000)
    assert [len(x) for x, _ in b.cycle(2)] == [0, 0]


def test_probability_is_drawn_from_the_seed(bench):
    def lost(seed, *more):
        b = bench(f.Drop(replace(TPDO_X, probability=0.3)), *more, seed=seed)
        b.enable()
        return [len(x) for x, _ in b.cycle(200)]

    assert 0.2 < lost(1).count(0) / 200 < 0.4
    assert lost(1) == lost(1)
    assert lost(1) != lost(2)
    # another fault with draws of its own changes nothing
    other = f.Drop(f.Frames(frozenset({0x182}), "drives", probability=0.5))
    assert lost(1) == lost(1, other)


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
    b = bench(f.Duplicate(of_x(nth=frozenset({2})), copies=2))
    b.enable()
    got = b.cycle(3)
    assert [len(x) for x, _ in got] == [1, 3, 1]
    assert len({(x.time_ns, x.data) for x in got[1][0]}) == 1


def test_a_delayed_frame_is_late_by_the_time_drawn(bench):
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


def test_a_reordered_frame_arrives_after_the_next(bench):
    b = bench(f.Reorder(replace(TPDO_X, nth=frozenset({2}))))
    b.enable()
    order = []
    for _ in range(3):
        b.host.frames.clear()
        b.host.send(0x080)
        order.append([x.can_id for x in b.host.frames])
        b.host.wait(1)
    assert order == [[0x181, 0x182], [0x182, 0x181], [0x181, 0x182]]


def test_a_reordered_frame_with_no_successor_arrives_after_hold(bench):
    b = bench(f.Reorder(f.Frames(frozenset({0x182}), "drives", nth=frozenset({1})), hold=5e-4))
    b.enable()
    sent = b.world.now_ns
    b.host.send(0x080)
    b.host.wait(1)
    assert [x.time_ns - sent for x in b.host.take(0x182)] == [500_000]


@pytest.mark.parametrize("length", [0, 3, 8])
def test_length(bench, length):
    b = bench(f.Resize(replace(TPDO_X, nth=frozenset({2})), length))
    b.enable()
    b.cycle(1)
    (bad,) = b.cycle(1)[0][0]
    (good,) = b.cycle(1)[0][0]
    assert len(good.data) == 8
    assert bad.data == good.data[:length]


def test_a_frozen_tpdo_repeats_earlier_data(bench):
    b = bench(f.Freeze(replace(TPDO_X, after=1.0)))
    b.enable()
    start = b.host.read_object(1, 0x6064, 0, "i")
    before = b.host.cycle(start)
    b.host.wait(1000)
    after = [b.host.cycle(start + 1000 * k) for k in (1, 2, 3)]
    assert after == [before] * 3
    assert b.host.read_object(1, 0x6064, 0, "i") > start + 1000
