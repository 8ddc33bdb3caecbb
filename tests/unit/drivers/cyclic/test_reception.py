"""Frames between two SYNCs: whose they are, when they arrived, and which come too late."""

import struct
from dataclasses import replace

import can
import pytest

from drivers.canopen import Network
from drivers.cyclic import Channel
from drivers.cyclic.reception import Reception
from drivers.drive import Axis

MS = 1_000_000
X, Y = 0x181, 0x182


def tpdo(position):
    return struct.pack("<Hih", 0x0637, position, 5)


class Stamped:
    """Frames with time stamps of the bus's own clock."""

    useless = False

    def __call__(self, stamp, now):
        return round(stamp * 1e9)


@pytest.fixture
def network(scripted):
    return Network(scripted, "scripted")


@pytest.fixture
def make(network, axis_settings, bus_settings):
    def reception(stamped=False, **changes):
        channels = [Channel(Axis(network, axis)) for axis in axis_settings]
        made = Reception(network, channels, replace(bus_settings, **changes))
        if stamped:
            made.arrival_of = Stamped()
        return made

    return reception


def deliver(scripted, can_id, data, at=0):
    scripted.queue.append(
        can.Message(arbitration_id=can_id, is_extended_id=False, data=data, timestamp=at * 1e-9)
    )


@pytest.fixture
def collected(make, scripted):
    """Collects the answers to a SYNC at 1 ms: CAN-ID, data, and time after it [ns] of each."""

    def collect(*frames, away=0, **options):
        reception = make(**options)
        for can_id, data, after in frames:
            deliver(scripted, can_id, data, MS + after)
        scripted.clock.now = MS + away
        reception.collect(scripted.recv, MS)
        return reception

    return collect


def test_the_wait_ends_with_the_last_answer(collected, scripted):
    reception = collected((Y, tpdo(2), 0), (X, tpdo(1), 0))
    assert [c.position for c in reception.channels] == [1, 2]
    assert (reception.missed, scripted.clock.now) == (0, MS)


def test_an_answer_that_is_missing_is_awaited_for_half_the_period(collected, scripted):
    reception = collected((X, tpdo(1), 0))
    assert [c.valid for c in reception.channels] == [True, False]
    assert (reception.missed, scripted.clock.now) == (1, MS + MS // 2)


def test_frames_of_services_are_passed_on_meanwhile(collected, network):
    seen = []
    network.subscribe(0x701, lambda *frame: seen.append(bytes(frame[1])))
    reception = collected((0x701, b"\x05", 0), (X, tpdo(1), 0), (Y, tpdo(2), 0))
    assert (seen, reception.missed) == ([b"\x05"], 0)


def test_a_frame_of_another_length_is_no_sample(collected):
    reception = collected((X, tpdo(1)[:-1], 0), (Y, tpdo(2), 0))
    assert [c.valid for c in reception.channels] == [False, True]


def test_a_second_answer_is_counted_and_the_first_one_taken(collected):
    x, _ = collected((X, tpdo(1), 0), (X, tpdo(1), 0), (Y, tpdo(2), 0)).channels
    assert (x.position, x.extra) == (1, 1)


def test_the_stamp_counts_however_late_the_host_reads(collected):
    frames = (X, tpdo(1), MS // 5), (Y, tpdo(2), MS // 4)
    reception = collected(*frames, away=3 * MS, stamped=True)
    assert [c.arrival for c in reception.channels] == [MS // 5, MS // 4]


def test_a_frame_from_before_the_sync_is_not_its_answer(collected):
    frames = (X, tpdo(7), -MS // 10), (X, tpdo(1), MS // 5), (Y, tpdo(2), MS // 5)
    x, _ = collected(*frames, stamped=True).channels
    assert (x.position, x.extra) == (1, 1)


def test_after_the_drives_window_nothing_counts(collected):
    frames = (X, tpdo(1), 290_000), (Y, tpdo(2), 310_000)
    reception = collected(*frames, stamped=True, sync_window=5e-4)
    assert [c.valid for c in reception.channels] == [True, False]
    assert not reception.accepts_tardy


@pytest.mark.parametrize(
    ("after", "tardy", "missed", "extra"),
    [(7 * MS // 10, (0x0637, 2, 5, 7 * MS // 10), 0, 0), (MS, None, 1, 1)],
)
def test_an_answer_after_the_wait_is_still_the_sample_of_its_sync(
    collected, scripted, after, tardy, missed, extra
):
    """Not one a period late."""
    reception = collected((X, tpdo(1), MS // 5), stamped=True)
    assert reception.missed == 1
    deliver(scripted, Y, tpdo(2), MS + after)
    reception.await_tpdos(2 * MS)
    y = reception.channels[1]
    assert (y.tardy, reception.missed, y.extra) == (tardy, missed, extra)


def test_our_own_sync_tells_when_it_was_on_the_bus(collected):
    frames = (0x80, b"", 30_000), (X, tpdo(1), MS // 5), (Y, tpdo(1), MS // 5)
    assert collected(*frames, stamped=True).echo_at == MS + 30_000


def test_the_kernels_syncs_are_counted_those_that_the_queue_lost_too(make, scripted):
    reception, begin = make(stamped=True), scripted.clock.now
    reception.follow_kernel(True)
    for period in (0, 1, 4):  # two were lost
        deliver(scripted, 0x80, b"", begin + period * MS)
    reception.drain(scripted.recv)
    assert reception.take_kernel_periods() == (5, begin + 4 * MS)
    assert reception.take_kernel_periods()[0] == 0


@pytest.mark.parametrize(("second", "found"), [(None, False), (1, True), (3, True)])
def test_a_second_sync_beside_the_kernels_is_another_host(make, network, scripted, second, found):
    """Every so many periods; the kernel's may be held up for 0.7 periods at any time."""
    reception, begin = make(stamped=True), scripted.clock.now
    reception.follow_kernel(True)
    for n in range(250):
        deliver(scripted, 0x80, b"", begin + n * MS + (n % 2) * 7 * MS // 10)
        if second is not None and n % second == 0:
            deliver(scripted, 0x80, b"", begin + n * MS + 8 * MS // 10)
    reception.drain(scripted.recv)
    assert network.other_host.found == ("a SYNC (0x080) beside the kernel's" if found else None)


def test_the_kernels_next_sync_ends_the_wait(make, scripted):
    reception, begin = make(stamped=True), scripted.clock.now
    reception.follow_kernel(True)
    deliver(scripted, 0x80, b"", begin + MS)
    deliver(scripted, X, tpdo(1), begin + MS + MS // 5)
    reception.collect(scripted.recv, begin)
    assert reception.missed == 2
    assert len(scripted.queue) == 1  # that one answers the next SYNC


def test_answers_of_a_bus_that_has_them_at_once_are_taken_as_they_are(make, scripted):
    reception, begin = make(), scripted.clock.now
    reception.take([tpdo(1), tpdo(2)], begin)
    assert [(c.position, c.arrival) for c in reception.channels] == [(1, 0), (2, 0)]
    assert (reception.sync_at, reception.missed) == (begin, 0)


def test_error_remote_and_extended_frames_are_nobodys(make, network, scripted):
    reception, seen = make(), []
    network.subscribe(0x701, lambda *frame: seen.append(frame))
    for kind in ("is_error_frame", "is_remote_frame", "is_extended_id"):
        marks = {"is_extended_id": False, kind: True}
        reception.dispatch(can.Message(arbitration_id=0x701, **marks))
    assert seen == []
