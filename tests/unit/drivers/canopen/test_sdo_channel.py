"""SDO transfers on buses that lose and delay answers, and from several threads."""

import struct
import threading

import can
import pytest
from canopen import SdoCommunicationError

from drivers.canopen import Network, SdoChannel
from drivers.errors import DriverError
from drivers.objects import ObjectRef


class Peer:
    """An SDO server that may hold its answers back; values count the reads."""

    next_beat = 1 << 62

    def __init__(self, scripted):
        self.scripted = scripted
        self.reads = []
        self.late = []
        self.hold = lambda n: False

    def tick(self, now):
        """It sends no heartbeat."""

    def on_frame(self, can_id, data):
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
def peer(scripted):
    found = Peer(scripted)
    scripted.drives.append(found)
    return found


def test_a_late_answer_is_never_taken_for_the_next_one(scripted, peer):
    channel = SdoChannel(Network(scripted, "scripted"), 5)
    peer.hold = lambda n: n == 1
    with pytest.raises(SdoCommunicationError):
        channel.upload(0x6064, 0)
    # read 1 is answered now, before read 2 (the fence) and 3: only 3 is this one's
    assert channel.upload(0x6064, 0) == struct.pack("<I", 3)
    assert peer.reads == [(0x6064, 0), (0x1000, 0), (0x6064, 0)]
    assert channel.upload(0x6064, 0) == struct.pack("<I", 4)


def test_a_late_answer_to_the_fence_is_not_taken_either(scripted, peer):
    channel = SdoChannel(Network(scripted, "scripted"), 5)
    peer.hold = lambda n: n <= 2
    for _ in range(2):
        with pytest.raises(SdoCommunicationError):
            channel.upload(0x1000, 0)
    assert channel.upload(0x1000, 0) == struct.pack("<I", 4)
    assert len(set(peer.reads[:3])) == 3


def test_a_missing_node_costs_one_timeout_per_access(scripted):
    channel = SdoChannel(Network(scripted, "scripted"), 9, timeout=0.2)
    for _ in range(3):
        start = scripted.clock.now
        with pytest.raises(SdoCommunicationError):
            channel.upload(0x1000, 0)
        assert 0.2e9 <= scripted.clock.now - start <= 0.21e9


def test_an_access_in_a_callback_is_refused_at_once(scripted):
    network = Network(scripted, "scripted")
    channel = SdoChannel(network, 1)
    caught = []

    def callback(*_):
        try:
            channel.upload(0x1000, 0)
        except DriverError as error:
            caught.append(error)

    network.subscribe(0x123, callback)
    scripted.deliver(0x123, b"")
    network.pump(0.0)
    assert "callback" in str(caught[0])


def test_an_access_of_another_thread_waits_for_the_callback(scripted, peer):
    network = Network(scripted, "scripted")
    channel = SdoChannel(network, 5)
    got = []
    other = threading.Thread(target=lambda: got.append(channel.upload(0x6064, 0)))

    def callback(*_):
        other.start()
        other.join(0.05)
        assert other.is_alive()

    network.subscribe(0x123, callback)
    scripted.deliver(0x123, b"")
    network.pump(0.0)
    other.join(10)
    assert got == [struct.pack("<I", 1)]


def test_only_the_owner_of_a_bus_uses_it(scripted, peer, monkeypatch):
    network = Network(scripted, "scripted")
    channel = SdoChannel(network, 5)
    network.owner = threading.get_ident()
    got = []

    def read():
        try:
            got.append(channel.upload(0x6064, 0))
        except SdoCommunicationError as silent:
            got.append(str(silent))

    other = threading.Thread(target=read)
    other.start()
    other.join(0.1)
    assert (got, peer.reads) == ([], [])  # waits, though the bus is free
    while other.is_alive():
        network.pump(0.05)
    assert got.pop() == struct.pack("<I", 1)
    monkeypatch.setattr("drivers.canopen.sdo_channel._POLLS", 3)
    other = threading.Thread(target=read)
    other.start()
    other.join(10)  # the owner does nothing
    assert "does not use it" in got[0]
    network.pump(0.1)
    assert peer.reads == [(0x6064, 0)]


def test_a_released_node_is_not_waited_for(scripted, peer, monkeypatch):
    network = Network(scripted, "scripted")
    channel = SdoChannel(network, 5)
    network.owner = -1  # another thread's, which has ended
    channel.detach()
    monkeypatch.setattr(
        "drivers.canopen.sdo_channel.time.sleep", lambda _: pytest.fail("it is waited for")
    )
    with pytest.raises(SdoCommunicationError, match="released"):
        channel.upload(0x6064, 0)
    assert peer.reads == []


def test_threads_share_a_channel_each_with_its_own_answers(pair):
    """Four threads read and write one node of a bus in real time; every answer is the right one."""
    ours, theirs = pair
    stop = threading.Event()

    def serve():
        while not stop.is_set():
            request = theirs.recv(0.01)
            if request is not None and request.arbitration_id == 0x605:
                place = bytes(request.data[1:4])
                answer = b"\x43" + place + place + b"\0"
                theirs.send(can.Message(arbitration_id=0x585, is_extended_id=False, data=answer))

    channel = SdoChannel(Network(ours, "virtual"), 5, timeout=60.0)
    wrong = []

    def read(start):
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


def test_another_thread_reads_during_a_stream_without_a_late_sync(scripted, stage):
    """The read is taken up by the streaming thread, between its SYNCs."""
    import numpy as np

    stage.enable()
    begun, done, got = threading.Event(), threading.Event(), []
    node = stage.axes[0].node

    def read():
        begun.set()
        got.append(node.read(ObjectRef(0x1018, 2, "product code")))
        done.set()

    reader = threading.Thread(target=read)

    def until(_):
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
