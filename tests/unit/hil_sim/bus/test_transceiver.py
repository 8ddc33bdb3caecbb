"""One node's connection: bus-off in both directions, and each frame once."""

from __future__ import annotations

import can
import pytest

from hil_sim.bus.lockstep import World
from hil_sim.bus.transceiver import Transceiver

Frames = list[tuple[int, bytes]]


@pytest.fixture
def sent() -> Frames:
    return []


@pytest.fixture
def node(bus: can.BusABC, sent: Frames) -> Transceiver:
    world: World = bus.world  # type: ignore[attr-defined]
    return Transceiver(world, 1, lambda can_id, data: sent.append((can_id, data)), None)


def send(bus: can.BusABC, can_id: int, data: bytes = b"") -> None:
    bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
    bus.recv(0)


def test_several_handlers_of_an_id_hear_a_frame_once_each(
    bus: can.BusABC, node: Transceiver
) -> None:
    heard: list[tuple[str, bytes]] = []
    node.subscribe(0x201, lambda data: heard.append(("one", data)))
    node.subscribe(0x201, lambda data: heard.append(("other", data)))
    send(bus, 0x201, b"\x07")
    send(bus, 0x202, b"\x08")
    assert heard == [("one", b"\x07"), ("other", b"\x07")]


def test_after_unsubscribing_and_subscribing_again_a_frame_comes_once(
    bus: can.BusABC, node: Transceiver
) -> None:
    heard: list[bytes] = []
    node.subscribe(0x201, heard.append)
    node.unsubscribe(0x201, heard.append)
    send(bus, 0x201, b"\x01")
    assert heard == []
    node.subscribe(0x201, heard.append)
    send(bus, 0x201, b"\x02")
    assert heard == [b"\x02"]


def test_bus_off_neither_sends_nor_receives_but_its_timers_go_on(
    bus: can.BusABC, node: Transceiver, sent: Frames
) -> None:
    heard: list[bytes] = []
    ticks: list[int] = []
    node.subscribe(0x201, heard.append)
    node.at(node.now_ns + 1000, lambda: ticks.append(node.now_ns))
    node.bus_off = True
    node.emit(0x181, b"\x01")
    send(bus, 0x201, b"\x02")
    bus.clock.sleep_until_ns(2000)  # type: ignore[attr-defined]
    assert (sent, heard, ticks) == ([], [], [1000])
    node.bus_off = False
    node.emit(0x181, b"\x03")
    send(bus, 0x201, b"\x04")
    assert (sent, heard) == ([(0x181, b"\x03")], [b"\x04"])


def test_a_frame_held_back_by_the_line_is_delivered_even_to_a_node_that_is_off(
    node: Transceiver,
) -> None:
    heard: list[bytes] = []
    node.subscribe(0x201, heard.append)
    node.bus_off = True
    node.deliver(0x201, b"\x05")
    assert heard == [b"\x05"]
