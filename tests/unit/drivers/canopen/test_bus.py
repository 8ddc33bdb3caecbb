"""The host's end of the bus: pumping, heartbeat, tap, errors."""

import sys

import can
import pytest

from drivers.canopen import Network, open_bus
from drivers.errors import BusError, BusOpenError
from drivers.settings import BusSettings
from tests.multicast import require_multicast


def test_pump_until_stops_at_the_condition_and_feeds_subscribers(pair):
    network = Network(pair[0], "virtual:test_bus")
    got = []
    network.subscribe(0x123, lambda i, data, t: got.append(bytes(data)))
    for value in range(3):
        pair[1].send(can.Message(arbitration_id=0x123, is_extended_id=False, data=[value]))
    assert network.pump_until(lambda: len(got) == 2, 1.0)
    assert got == [b"\0", b"\1"]
    assert not network.pump_until(lambda: len(got) == 9, 0.01)
    assert got == [b"\0", b"\1", b"\2"]


def test_heartbeats_are_sent_while_pumping_without_a_burst_after_a_pause(scripted):
    network = Network(scripted, "scripted")
    network.pump(1.0)
    beats = [t for t, i, data in scripted.sent if (i, data) == (0x77F, b"\x05")]
    assert 9 <= len(beats) <= 11
    scripted.clock.now += 5_000_000_000
    network.pump(0.2)
    assert 1 <= len([i for _, i, _ in scripted.sent if i == 0x77F]) - len(beats) <= 4


def test_the_tap_sees_both_directions(pair):
    seen = []
    network = Network(pair[0], "virtual", tap=lambda t, i, data: seen.append((i, data)))
    network.send_message(0x601, b"\x40")
    pair[1].send(can.Message(arbitration_id=0x581, is_extended_id=False, data=b"\x60"))
    network.pump(0.0)
    assert [s for s in seen if s[0] != 0x77F] == [(0x601, b"\x40"), (0x581, b"\x60")]


def test_malformed_and_foreign_frames_are_ignored(scripted, stage):
    for can_id, data, extended in (
        (0x081, b"\x01", False), (0x701, b"", False), (0x701, b"\0\0", False),
        (0x581, b"\x80", False), (0x1FFFFFFF, bytes(8), True), (0x181, b"\1", False),
    ):  # fmt: skip
        scripted.queue.append(
            can.Message(arbitration_id=can_id, is_extended_id=extended, data=bytearray(data))
        )
    scripted.queue.append(can.Message(is_error_frame=True))
    stage.enable()
    assert stage.enabled


@pytest.mark.parametrize("interface", ["no_such_interface", "socketcan"])
def test_a_bus_that_cannot_be_opened_is_named(interface):
    with pytest.raises(BusError, match=rf"^bus {interface}:nowhere: cannot open: \S") as caught:
        open_bus(BusSettings(interface, "nowhere"))
    assert "\n" not in str(caught.value)


@pytest.mark.real_time
def test_frames_of_another_multicast_group_are_not_received():
    ours, theirs = "239.74.163.81", "239.74.163.82"
    require_multicast(ours)
    with (
        open_bus(BusSettings("udp_multicast", ours)) as bus,
        can.Bus(interface="udp_multicast", channel=theirs) as other,
        can.Bus(interface="udp_multicast", channel=ours) as same,
    ):
        for sender, can_id in ((other, 0x701), (same, 0x702)):
            sender.send(can.Message(arbitration_id=can_id, is_extended_id=False, data=[0x51]))
        heard = bus.recv(10.0)
        assert heard is not None
        assert heard.arbitration_id == 0x702
        assert bus.recv(0.05) is None


@pytest.mark.skipif(sys.platform != "linux", reason="SocketCAN is of Linux")
def test_an_interface_that_is_not_there_is_refused_before_a_socket_is_made(monkeypatch):
    """python-can leaves the socket open that it then cannot bind."""
    monkeypatch.setattr(can, "Bus", lambda **_: pytest.fail("opened"))
    settings = BusSettings("socketcan", "nosuchcan9")
    with pytest.raises(BusOpenError, match=r"socketcan:nosuchcan9: cannot open: .*No such device"):
        open_bus(settings)
