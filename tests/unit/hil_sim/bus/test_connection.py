"""A bus that goes away: python-can's `virtual`, closed under the connection and opened again."""

from __future__ import annotations

import itertools

import can
import pytest
from can.interfaces.virtual import VirtualBus

from hil_sim.bus.connection import RETRY_NS, Connection

_names = itertools.count()
FRAME = can.Message(arbitration_id=0x123, data=b"\1\2", is_extended_id=False)
BUS_OFF = can.Message(arbitration_id=0x040, data=bytes(8), is_error_frame=True)
RESTARTED = can.Message(arbitration_id=0x100, data=bytes(8), is_error_frame=True)


class Rig:
    """A connection, the bus' other end, and an interface that can be there or not."""

    def __init__(self):
        self.channel = f"away-{next(_names)}"
        self.there = True
        self.now_ns = 0
        self.notices: list[str] = []
        self.opened = [self.open()]
        self.other = self.open()
        self.connection = Connection(
            self.opened[0], self.reopen, self.notices.append, lambda: self.now_ns
        )

    def open(self):
        return can.Bus(interface="virtual", channel=self.channel)

    def reopen(self):
        if not self.there:
            return None
        self.opened.append(self.open())
        return self.opened[-1]

    def remove(self):
        self.there = False
        self.opened[-1].shutdown()

    def hears(self):
        message = self.connection.recv(0.001)
        return None if message is None else bytes(message.data)


@pytest.fixture
def rig():
    rig = Rig()
    yield rig
    rig.connection.close()
    rig.other.shutdown()


def test_frames_both_ways(rig):
    assert rig.connection.send(FRAME)
    assert bytes(rig.other.recv(0).data) == b"\1\2"
    rig.other.send(FRAME)
    assert rig.hears() == b"\1\2"
    assert rig.notices == []


def test_a_lost_bus_is_reported_once_and_used_again_when_it_returns(rig):
    for outage in (1, 2):
        rig.remove()
        for _ in range(20):
            rig.now_ns += RETRY_NS // 3
            assert rig.hears() is None
            assert not rig.connection.send(FRAME)
        assert len(rig.notices) == 2 * outage - 1
        assert rig.notices[-1].endswith("the drives wait for it")
        rig.there = True
        while len(rig.notices) < 2 * outage:
            rig.now_ns += RETRY_NS // 3
            rig.hears()
        assert rig.notices[-1] == "is back"
        assert rig.connection.send(FRAME)
        rig.other.send(FRAME)
        assert rig.hears() == b"\1\2"
    assert len(rig.opened) == 3


class StrayOnce(VirtualBus):
    """The first thing to come is no CAN frame, as a stray datagram on udp_multicast."""

    stray = True

    def recv(self, timeout=None):
        if self.stray:
            self.stray = False
            raise can.CanOperationError("could not unpack received message")
        return super().recv(timeout)


def test_a_single_malformed_datagram_is_ignored(rig):
    bus = StrayOnce(rig.channel)
    connection = Connection(bus, rig.reopen, rig.notices.append, lambda: rig.now_ns)
    rig.other.send(FRAME)
    assert connection.recv(0) is None
    assert connection.recv(0) is not None
    assert rig.notices == []
    connection.close()


@pytest.mark.parametrize("sign", [RESTARTED, FRAME])
def test_bus_off_ends_with_a_restart_or_a_frame(rig, sign):
    rig.other.send(BUS_OFF)
    rig.other.send(BUS_OFF)
    for _ in range(10):
        rig.now_ns += RETRY_NS
        rig.connection.recv(0)
    assert rig.notices == ["bus-off; the drives wait for it"]
    assert len(rig.opened) == 1  # the socket has not failed
    rig.other.send(sign)
    rig.connection.recv(0)
    assert rig.notices[1:] == ["is back"]


def test_a_failure_without_reopen_is_an_error(rig):
    bus = rig.open()
    connection = Connection(bus)
    bus.shutdown()
    assert not connection.send(FRAME)
    with pytest.raises(can.CanOperationError):
        connection.recv(0)
