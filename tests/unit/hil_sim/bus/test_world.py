"""Virtual time: timers, names, who hears what."""

from __future__ import annotations

import can
import pytest

from hil_sim.bus.world import World


def frame(can_id, data=b""):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


def test_timers_run_in_order_and_may_be_cancelled(bus):
    world, seen = bus.world, []
    world.at(20, lambda: seen.append("late"))
    world.at(10, lambda: seen.append("first"))
    world.at(10, lambda: seen.append("second"))
    world.at(15, lambda: seen.append("never")).cancel()
    bus.clock.sleep_until_ns(30)
    assert seen == ["first", "second", "late"]


def test_waiting_without_limit_and_timer_is_an_error(bus):
    with pytest.raises(can.CanOperationError, match="no timer is pending"):
        bus.recv(None)


def test_nodes_hear_only_data_frames_with_short_ids(name, bus):
    heard = []
    bus.world.subscribe(0x100, heard.append)
    bus.send(can.Message(arbitration_id=0x100, is_extended_id=True))
    bus.send(can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True))
    bus.send(frame(0x100, b"\x07"))
    assert heard == [b"\x07"]


def test_a_new_world_replaces_one_of_the_same_name(name):
    old = World(name)
    new = World(name)
    assert World.get(name) is new is not old
    assert World.get(0) is World.get("0")
