"""The real-time segment on a scripted bus and clock: late loops, refused frames, no bus."""

from __future__ import annotations

import errno
import struct

import can
import pytest

from hil_sim.bus.server import RealTimeSegment
from hil_sim.stage import VirtualStage

MS = 1_000_000


class ScriptedBus(can.BusABC):
    """Delivers frames at given times; every wait takes as long as asked, plus `delay_ns`."""

    def __init__(self) -> None:
        self.now_ns = 5_000_000_000  # as a monotonic clock: of no meaning
        self.delay_ns = 0
        self.inbox: list[can.Message] = []
        self.sent: list[can.Message] = []
        self.full = False
        super().__init__(channel="scripted")

    def recv(self, timeout: float | None = None) -> can.Message | None:
        assert timeout is not None
        assert timeout >= 0
        if self.inbox:
            return self.inbox.pop(0)
        self.now_ns += round(timeout * 1e9) + self.delay_ns
        return None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
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


def start_move(bus, segment, target_nm):
    run(segment, 25)
    write(bus, segment, 0x6060, "b", 1)
    write(bus, segment, 0x6081, "I", 10_000_000)  # 10 mm/s
    write(bus, segment, 0x6086, "h", 0)
    for word in (0x06, 0x07, 0x0F):
        write(bus, segment, 0x6040, "H", word)
    write(bus, segment, 0x607A, "i", target_nm)
    write(bus, segment, 0x6040, "H", 0x1F)


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


class NetworkDown(ScriptedBus):
    """As SocketCAN: reports once that the interface is down, then nothing; sending is refused."""

    down = reported = False

    def recv(self, timeout: float | None = None) -> can.Message | None:
        if self.down and not self.reported:
            self.reported = True
            self.refuse()
        return super().recv(timeout)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.down:
            self.refuse()
        super().send(msg, timeout)

    def refuse(self) -> None:
        try:
            raise OSError(errno.ENETDOWN, "Network is down")
        except OSError as why:
            raise can.CanOperationError("Error receiving", why.errno) from why


def test_drives_whose_bus_is_down_for_two_seconds_stop_by_themselves(stage_settings, plant):
    said: list[str] = []
    with NetworkDown() as bus:

        def reopen() -> can.BusABC:
            bus.reported = False  # a new socket
            return bus

        segment = RealTimeSegment(bus, clock=lambda: bus.now_ns, reopen=reopen, notify=said.append)
        VirtualStage(stage_settings, 1, plant=plant).attach(segment)
        run(segment, 25)
        write(bus, segment, 0x1016, "I", 127 << 16 | 100, sub=1)
        write(bus, segment, 0x1017, "H", 50)
        start_move(bus, segment, 50_000_000)
        bus.inbox.append(can.Message(arbitration_id=0x77F, data=b"\5", is_extended_id=False))
        run(segment, 50)
        assert plant.powered == [True, False]
        bus.down = True
        run(segment, 2000)
        assert plant.powered == [False, False]
        assert plant.encoder(0) < 10_000_000  # it would take 5 s to the target
        assert said == ["Network is down; the drives wait for it"]
        assert segment.refused > 20
        bus.down = False
        run(segment, 600)
        assert said[1:] == ["is back"]
        write(bus, segment, 0x6060, "b", 8)
