"""Moves by the drive's own profile: relative, queued, changed on the way, halted."""

import struct

import numpy as np
import pytest

from drivers.errors import AxisFault
from tests.lockstep import open_stage, power_up


@pytest.fixture
def frames():
    return []


@pytest.fixture
def stage(stage_machine, frames):
    with open_stage(stage_machine, tap=lambda *f: frames.append(f))[0] as stage:
        power_up(stage)
        frames.clear()
        yield stage


def handed_over(frames):
    """(time [ns], target, controlword) of every rising edge of bit 4 to node 1."""
    edges, before = [], 0
    for time_ns, can_id, data in frames:
        if can_id == 0x201 and len(data) == 8:
            word, target, _ = struct.unpack("<Hih", data)
            if word & 0x10 and not before & 0x10:
                edges.append((time_ns, target, word))
            before = word
    return edges


@pytest.mark.parametrize("relative", [False, True])
def test_setpoints_queue_in_the_drive(stage, frames, relative):
    start = stage.targets[0]
    way = [2e-3, -1e-3, 3e-3]
    path = way if relative else [start + sum(way[: n + 1]) for n in range(3)]
    stage.move_to("x", path, velocity=0.05, acceleration=1.0, relative=relative)
    assert stage.targets[0] - start == pytest.approx(4e-3, abs=3e-6)
    edges = handed_over(frames)
    bits = [word & 0x70 for _, _, word in edges]
    assert bits == ([0x70, 0x50, 0x50] if relative else [0x30, 0x10, 0x10])
    # the second is in the drive long before the first is done: 2 mm at 50 mm/s take 90 ms
    assert edges[1][0] - edges[0][0] < 20e6
    positions = [
        struct.unpack("<Hih", data)[1] for _, can_id, data in frames if can_id == 0x181
    ]  # fmt: skip
    far = max(positions[: len(positions) // 2])
    assert far * 1e-9 - start == pytest.approx(2e-3, abs=5e-5)  # each is reached


def track(frames):
    """Positions of node 1 as it reported them [m]."""
    return [struct.unpack("<Hih", d)[1] * 1e-9 for _, i, d in frames if i == 0x181 and len(d) == 8]


SLOW = {"velocity": 0.02, "acceleration": 1.0}


def test_a_new_target_takes_effect_at_once_during_a_move(stage, frames):
    start = stage.targets[0]
    with stage.profile_moves(**SLOW) as moves:
        moves.to("x", start + 5e-3)
        moves.run(0.1)
        assert abs(stage.positions[0] - start - 1.8e-3) < 0.5e-3  # under way
        moves.to("x", start - 1e-3)
        moves.run(0.05)
        moves.to("x", 0.5e-3, relative=True)  # from the target before, wherever the axis is
    assert stage.enabled
    assert stage.positions[0] - start == pytest.approx(-0.5e-3, abs=2e-6)
    assert max(track(frames)) - start < 3e-3
    assert min(track(frames)) - start > -0.52e-3  # nor did it go to the second one
    assert [word & 0x270 for _, _, word in handed_over(frames)] == [0x30, 0x30, 0x70]
    stage.hold(0.05)  # csp goes on from there, also after a distance in 0x607A
    assert stage.positions[0] - start == pytest.approx(-0.5e-3, abs=2e-6)


@pytest.mark.parametrize("relative", [False, True])
def test_a_queued_target_is_replaced_by_one_at_once(stage, frames, relative):
    start = stage.targets[0]
    with stage.profile_moves(**SLOW) as moves:
        moves.to("x", start + 5e-3)
        moves.to("x", start + 8e-3, queued=True)
        moves.run(0.05)
        moves.to("x", -6e-3 if relative else start + 2e-3, relative=relative)
        moves.wait()
        assert stage.positions[0] - start == pytest.approx(2e-3, abs=2e-6)
        moves.run(0.1)  # and nothing follows
    assert stage.positions[0] - start == pytest.approx(2e-3, abs=2e-6)
    assert max(track(frames)) - start < 2.1e-3


@pytest.mark.parametrize("passing", [True, False])
def test_a_target_is_passed_without_a_stop_or_with_one(stage, frames, passing):
    start = stage.targets[0]
    with stage.profile_moves(**SLOW) as moves:
        moves.to("x", start + 2e-3)
        moves.to("x", start + 4e-3, queued=True, passing=passing, velocity=0.01)
    assert stage.positions[0] - start == pytest.approx(4e-3, abs=2e-6)
    way = np.array(track(frames)) - start
    speed = np.diff(way[::5]) / 5e-3
    around = speed[(way[::5][1:] > 1.95e-3) & (way[::5][:-1] < 2.05e-3)]
    assert bool(around.min() > 9e-3) is passing  # 10 mm/s from there on, or a stop
    assert bool(around.max() > 15e-3) is passing
    assert [word & 0x270 for _, _, word in handed_over(frames)] == [
        0x30,
        0x210 if passing else 0x10,
    ]


def test_halt_keeps_the_targets_and_both_axes_go_on(stage):
    x, y = stage.targets
    with stage.profile_moves(**SLOW) as moves:
        moves.to("x", x + 3e-3)
        moves.to("y", y - 3e-3, velocity=0.03)
        moves.run(0.05)
        moves.halt()
        held = stage.positions
        assert x + 0.5e-3 < held[0] < x + 2e-3
        assert y - 2.5e-3 < held[1] < y - 0.5e-3
        moves.run(0.1)
        assert stage.positions == pytest.approx(held, abs=1e-6)
        with pytest.raises(AxisFault, match="is halted: resume it first"):
            moves.wait()
        moves.to("y", y - 1e-3)  # taken, and begun with the others
        moves.run(0.05)
        assert stage.positions == pytest.approx(held, abs=1e-6)
        moves.resume()
        moves.wait()
        assert stage.positions == pytest.approx((x + 3e-3, y - 1e-3), abs=2e-6)


def test_a_halted_move_ends_where_the_axis_stands(stage):
    x = stage.targets[0]
    with stage.profile_moves(**SLOW) as moves:
        moves.to("x", 3e-3, relative=True)
        moves.run(0.05)
        moves.halt()
        held = stage.positions
    assert stage.enabled
    stage.hold(0.05)
    assert stage.positions == pytest.approx(held, abs=1e-6)
    assert held[0] - x > 0.3e-3


def test_an_exception_inside_the_block_stops_the_axes(stage):
    start = stage.targets[0]

    def interrupted():
        with stage.profile_moves(**SLOW) as moves:
            moves.to("x", start + 20e-3)
            moves.run(0.1)
            raise RuntimeError("of the caller's own")

    with pytest.raises(RuntimeError):
        interrupted()
    assert not stage.enabled
    assert stage.positions[0] < start + 5e-3
