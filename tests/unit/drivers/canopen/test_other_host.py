"""Another host on the bus is detected, and our own frames coming back are not taken for it."""

import can
import pytest

from drivers.canopen.other_host import OtherHost, may_echo
from drivers.errors import BusError
from drivers.stage import Stage

MS = 1_000_000


def frame(can_id, data=b"", is_rx=True):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False, is_rx=is_rx)


def test_without_echoes_every_host_frame_received_is_of_another_host():
    other = OtherHost(echoes=False)
    found = []
    other.on_found = lambda: found.append(other.found)
    other.has_sent(frame(0x77F, b"\x05", is_rx=False), 0)
    assert found == []
    other.has_sent(frame(0x77F, b"\x05"), 0)
    other.has_sent(frame(0x080), 0)
    assert found == ["a heartbeat of node 127 (0x77F)"]


def test_echoes_of_own_frames_are_own_however_late_or_often():
    other = OtherHost(echoes=True)
    other.ids.add(0x201)
    for k in range(50):  # read much later, with some lost on the way
        other.note_sent(0x201, bytes([k]), k * MS)
    for k in (0, 1, 2, 5, 9, 10, 49):
        other.has_sent(frame(0x201, bytes([k])), 300 * MS)
    other.note_sent(0x080, b"", 400 * MS)
    for _ in range(3):  # a network that doubles frames
        other.has_sent(frame(0x080), 401 * MS)
    assert other.found is None


@pytest.mark.parametrize(
    ("can_id", "data", "at", "said"),
    [
        (0x201, b"\x0f\x01", 11, "setpoints for node 1 (0x201)"),
        (0x000, b"\x82\x00", 11, "the NMT command 'reset communication' (0x000) for all nodes"),
        (0x77F, b"\x05", 60, "a heartbeat of node 127 (0x77F)"),
        (0x080, b"", 60, "a SYNC (0x080)"),
    ],
)
def test_frames_that_were_never_sent_are_of_another_host(can_id, data, at, said):
    other = OtherHost(echoes=True)
    other.ids.add(0x201)
    for own in (frame(0x201, b"\x0f\x00"), frame(0x080), frame(0x77F, b"\x05"), frame(0, b"\1\1")):
        other.note_sent(own.arbitration_id, bytes(own.data), 10 * MS)
        other.has_sent(own, 10 * MS)
    other.has_sent(frame(can_id, data), at * MS)
    assert other.found == said


def test_a_sync_sent_by_the_kernel_is_our_own():
    other = OtherHost(echoes=True)
    other.sent_elsewhere.add(0x080)
    other.has_sent(frame(0x080), 0)
    assert other.found is None


def test_another_host_is_detected_before_anything_is_sent(bus_settings, axis_settings, pair):
    ours, theirs = pair
    assert not may_echo(ours)
    seen = []
    with Stage.open(bus_settings, axis_settings, lambda t, i, data: seen.append(i), ours) as stage:
        theirs.send(frame(0x701, b"\0"))  # a drive that boots just now is not let go of
        theirs.send(frame(0x080))
        with pytest.raises(BusError, match=r"another host is on it: a SYNC \(0x080\)"):
            stage.boot()
    assert theirs.recv(0) is None
    assert seen == [0x701, 0x080]
