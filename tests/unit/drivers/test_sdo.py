"""SDO: the protocol frame by frame, and a channel on buses that lose and delay answers."""

from __future__ import annotations

import struct
import threading
from binascii import crc_hqx
from collections.abc import Callable
from random import Random
from typing import Any

import can
import pytest
from canopen import SdoAbortedError, SdoCommunicationError
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import Network, SdoChannel, sdo
from drivers.errors import DriverError
from drivers.objects import ObjectRef
from drivers.stage import Stage


def head(command: int, index: int = 0x2000, sub: int = 1) -> bytes:
    return struct.pack("<BHB", command, index, sub)


def answers(transfer: sdo.Transfer, *frames: bytes) -> tuple[list[Any], bytes | None]:
    """What the client sent after each answer, and what it returned."""
    sent: list[Any] = [next(transfer)]
    for frame in frames:
        try:
            sent.append(transfer.send(frame.ljust(8, b"\0")))
        except StopIteration as end:
            return sent, end.value
    return sent, None


def test_expedited_both_ways() -> None:
    sent, value = answers(sdo.upload(0x2000, 1), head(0x4B) + b"\x34\x12")
    assert sent == [(head(0x40) + bytes(4),)]
    assert value == b"\x34\x12"
    sent, value = answers(sdo.download(0x2000, 1, b"\x34\x12"), head(0x60))
    assert sent == [(head(0x2B) + b"\x34\x12\0\0",)]
    assert value == b""


def test_answers_to_something_else_are_passed_over() -> None:
    sent, value = answers(
        sdo.upload(0x2000, 1),
        head(0x4F, 0x2000, 2) + b"\x99",  # another sub-index
        head(0x4F, 0x3000, 1) + b"\x99",
        head(0x60),  # a write of this object
        head(0x80, 0x3000, 1) + b"\0\0\2\6",  # another transfer's abort
        head(0x4F) + b"\x07",
    )
    assert sent[1:] == [None] * 4
    assert value == b"\x07"


def test_a_segment_with_the_toggle_before_is_passed_over() -> None:
    sent, value = answers(
        sdo.upload(0x2000, 1),
        head(0x41) + struct.pack("<I", 9),
        b"\x00abcdefg",
        b"\x00ABCDEFG",  # the first one again
        b"\x1bhi",
    )
    assert value == b"abcdefghi"
    assert sent[3] is None


def test_an_upload_of_another_length_than_announced_is_refused() -> None:
    with pytest.raises(SdoAbortedError):
        answers(sdo.upload(0x2000, 1), head(0x41) + struct.pack("<I", 3), b"\x01abcdefg")


@given(st.integers(0, 300), st.integers(1, 127), st.integers(0, 1000))
def test_block_download_survives_lost_segments(length: int, size: int, seed: int) -> None:
    draws = Random(seed)  # noqa: S311
    data = bytes(i * 7 & 0xFF for i in range(length))
    transfer = sdo.block_download(0x2000, 1, data)
    assert next(transfer) == (head(0xC6) + struct.pack("<I", len(data)),)
    got = b""
    frames = transfer.send(head(0xA4) + bytes((size, 0, 0, 0)))
    left = max(1, -(-length // 7))
    while left:
        assert frames is not None
        assert [f[0] & 0x7F for f in frames] == list(range(1, min(left, size) + 1))
        kept = draws.randint(0, len(frames))
        left -= kept
        got += b"".join(f[1:] for f in frames[:kept])
        frames = transfer.send(bytes((0xA2, kept, size, 0, 0, 0, 0, 0)))
    assert frames is not None
    (end,) = frames
    got = got[: len(got) - (end[0] >> 2 & 7)]
    assert got == data
    assert struct.unpack_from("<H", end, 1)[0] == crc_hqx(data, 0)
    with pytest.raises(StopIteration):
        transfer.send(bytes((0xA1,)) + bytes(7))


def test_block_upload_asks_again_from_the_last_good_segment() -> None:
    data = bytes(range(20))
    crc = struct.pack("<H", crc_hqx(data, 0))
    sent, value = answers(
        sdo.block_upload(0x2000, 1),
        head(0xC6) + struct.pack("<I", 20),
        b"\x01" + data[:7],
        b"\x83" + data[14:].ljust(7, b"\0"),  # the second was lost
        b"\x01" + data[7:14],
        b"\x82" + data[14:].ljust(7, b"\0"),
        b"\xc5" + crc,
    )
    assert sent[1] == (b"\xa3" + bytes(7),)
    assert sent[3] == (b"\xa2\x01\x7f" + bytes(5),)
    assert sent[5] == (b"\xa2\x02\x7f" + bytes(5),)
    assert value == data


def test_block_upload_with_a_wrong_checksum_is_refused() -> None:
    with pytest.raises(SdoAbortedError, match="05040004"):
        answers(sdo.block_upload(0x2000, 1), head(0xC6), b"\x81abcdefg", b"\xc1\x01\x02")


class Peer:
    """An SDO server that may hold its answers back; values count the reads."""

    def __init__(self, scripted: Any) -> None:
        self.scripted = scripted
        self.reads: list[tuple[int, int]] = []
        self.late: list[bytes] = []
        self.hold: Callable[[int], bool] = lambda n: False

    def on_frame(self, can_id: int, data: bytes) -> None:
        if can_id != 0x605 or data[0] != 0x40:
            return
        _, index, sub = struct.unpack_from("<BHB", data)
        self.reads.append((index, sub))
        answer = data[:1].replace(b"\x40", b"\x43") + data[1:4] + struct.pack("<I", len(self.reads))
        if self.hold(len(self.reads)):
            self.late.append(answer)
            return
        for frame in (*self.late, answer):
            self.scripted.deliver(0x585, frame)
        self.late.clear()


@pytest.fixture
def peer(scripted: Any) -> Peer:
    found = Peer(scripted)
    scripted.drives.append(found)
    found.next_beat = 1 << 62  # type: ignore[attr-defined]
    found.tick = lambda now: None  # type: ignore[attr-defined]
    return found


def test_a_late_answer_is_never_taken_for_the_next(scripted: Any, peer: Peer) -> None:
    channel = SdoChannel(Network(scripted, "scripted"), 5)
    peer.hold = lambda n: n == 1
    with pytest.raises(SdoCommunicationError):
        channel.upload(0x6064, 0)
    # read 1 is answered now, before read 2 (the fence) and 3: only 3 is this one's
    assert channel.upload(0x6064, 0) == struct.pack("<I", 3)
    assert peer.reads == [(0x6064, 0), (0x1000, 0), (0x6064, 0)]
    assert channel.upload(0x6064, 0) == struct.pack("<I", 4)


def test_a_late_answer_to_the_fence_is_not_taken_either(scripted: Any, peer: Peer) -> None:
    channel = SdoChannel(Network(scripted, "scripted"), 5)
    peer.hold = lambda n: n <= 2
    for _ in range(2):
        with pytest.raises(SdoCommunicationError):
            channel.upload(0x1000, 0)
    assert channel.upload(0x1000, 0) == struct.pack("<I", 4)
    assert len(set(peer.reads[:3])) == 3


def test_a_node_that_is_gone_costs_one_timeout_each(scripted: Any) -> None:
    channel = SdoChannel(Network(scripted, "scripted"), 9, timeout=0.2)
    for _ in range(3):
        start = scripted.clock.now
        with pytest.raises(SdoCommunicationError):
            channel.upload(0x1000, 0)
        assert 0.2e9 <= scripted.clock.now - start <= 0.21e9


def test_an_access_in_a_callback_is_refused_at_once(scripted: Any) -> None:
    network = Network(scripted, "scripted")
    channel = SdoChannel(network, 1)
    caught: list[Exception] = []

    def callback(*_: object) -> None:
        try:
            channel.upload(0x1000, 0)
        except DriverError as error:
            caught.append(error)

    network.subscribe(0x123, callback)
    scripted.deliver(0x123, b"")
    network.pump(0.0)
    assert "callback" in str(caught[0])


def test_threads_share_a_channel_each_with_its_own_answers() -> None:
    """Four threads read and write one node of a bus in real time; every answer is the right one."""
    with (
        can.Bus(interface="virtual", channel="test_sdo") as ours,
        can.Bus(interface="virtual", channel="test_sdo") as theirs,
    ):
        stop = threading.Event()

        def serve() -> None:
            while not stop.is_set():
                request = theirs.recv(0.01)
                if request is not None and request.arbitration_id == 0x605:
                    data = bytes(request.data)
                    answer = b"\x43" + data[1:4] + data[1:4] + b"\0"
                    theirs.send(
                        can.Message(arbitration_id=0x585, is_extended_id=False, data=answer)
                    )

        channel = SdoChannel(Network(ours, "virtual"), 5, timeout=60.0)
        wrong: list[object] = []

        def read(start: int) -> None:
            for n in range(start, start + 100):
                value = channel.upload(n, 7)
                if value != struct.pack("<HBB", n, 7, 0):
                    wrong.append((n, value))

        server = threading.Thread(target=serve)
        readers = [threading.Thread(target=read, args=(0x2000 + 0x100 * i,)) for i in range(4)]
        for thread in (server, *readers):
            thread.start()
        for thread in readers:
            thread.join(300)
            assert not thread.is_alive()
        stop.set()
        server.join()
    assert wrong == []


def test_another_thread_reads_during_a_stream_without_a_late_sync(
    scripted: Any, stage: Stage
) -> None:
    """The read is taken up by the streaming thread, between its SYNCs."""
    import numpy as np

    stage.enable()
    begun, done, got = threading.Event(), threading.Event(), []
    node = stage.axes[0].node

    def read() -> None:
        begun.set()
        got.append(node.read(ObjectRef(0x1018, 2, "product code")))
        done.set()

    reader = threading.Thread(target=read)

    def until(_: object) -> bool:
        if not begun.is_set():
            reader.start()
            begun.wait(100)
        return done.wait(0.001)  # the reader's turn; no virtual time passes

    position = np.tile(stage.targets, (20_000, 1))
    samples = stage.stream(position, np.zeros_like(position), until=until)
    reader.join(100)
    assert got == [0x402]
    assert not samples.late.any()
    assert samples.valid.all()
