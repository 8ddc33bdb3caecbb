"""The real-time segment on a scripted bus and clock; a bus that goes away: test_connection.py."""

import struct

import can
import pytest

from hil_sim.bus.server import RealTimeSegment
from hil_sim.stage import VirtualStage

MS = 1_000_000


class ScriptedBus(can.BusABC):
    """Delivers frames at given times; every wait takes as long as asked, plus `delay_ns`."""

    def __init__(self):
        self.now_ns = 5_000_000_000  # as a monotonic clock: of no meaning
        self.delay_ns = 0
        self.inbox = []
        self.sent = []
        self.full = False
        super().__init__(channel="scripted")

    def recv(self, timeout=None):
        assert timeout is not None
        assert timeout >= 0
        if self.inbox:
            return self.inbox.pop(0)
        self.now_ns += round(timeout * 1e9) + self.delay_ns
        return None

    def send(self, msg, timeout=None):
        if self.full:
            raise can.CanOperationError("transmit buffer full")
        self.sent.append(msg)


@pytest.fixture
def bus():
    with ScriptedBus() as bus:
        yield bus


@pytest.fixture
def segment(bus, stage_settings, plant):
    segment = RealTimeSegment(bus, clock=lambda: bus.now_ns)
    VirtualStage(stage_settings, 1, plant=plant).attach(segment)
    return segment


def run(segment, milliseconds):
    end = segment.now_ns + milliseconds * MS
    while segment.now_ns < end:
        segment.handle_next()


def write(bus, segment, index, fmt, value, sub=0):
    data = struct.pack("<" + fmt, value)
    head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub)
    payload = head + data.ljust(4, b"\0")
    bus.inbox.append(can.Message(arbitration_id=0x601, data=payload, is_extended_id=False))
    segment.handle_next()
    assert bus.sent[-1].data[0] == 0x60


def test_time_counts_from_the_start_of_the_segment(bus, segment):
    run(segment, 25)
    assert [(m.arbitration_id, bytes(m.data)) for m in bus.sent] == [
        (0x701, b"\0"),
        (0x702, b"\0"),
    ]
    assert not bus.sent[0].is_extended_id


def test_refused_frames_are_counted_and_the_drive_goes_on(bus, segment):
    bus.full = True
    run(segment, 25)
    assert segment.refused == 2
    bus.full = False
    write(bus, segment, 0x6060, "b", 8)


def test_frames_that_are_not_for_drives(bus, segment):
    run(segment, 25)
    count = len(bus.sent)
    for flags in ({"is_extended_id": True}, {"is_remote_frame": True}, {"is_error_frame": True}):
        options = {"is_extended_id": False, **flags}
        bus.inbox.append(can.Message(arbitration_id=0x601, data=bytes(8), **options))
        segment.handle_next()
    assert len(bus.sent) == count
