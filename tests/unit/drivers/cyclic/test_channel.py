"""The account of an axis' TPDOs from SYNC to SYNC: missing, late, doubled, ambiguous."""

import struct

import pytest

from drivers.canopen import Network
from drivers.cyclic import Channel
from drivers.drive import Axis


def tpdo(position):
    return struct.pack("<Hih", 0x0637, position, 5)


def sync(channel, *frames):
    """One SYNC, answered by these frames; returns whether it brought a sample."""
    channel.close_cycle()
    channel.open_cycle()
    for number, frame in enumerate(frames):
        if number == 0:
            channel.take(frame, 1000)
        else:
            channel.take_extra(frame)
    return channel.conclude()


@pytest.fixture
def channel(scripted, axis_settings):
    return Channel(Axis(Network(scripted, "scripted"), axis_settings[0]))


def test_identical_tpdos_are_a_sample_and_counted_as_doubled(channel):
    for count in range(3):
        assert sync(channel, tpdo(7), tpdo(7))
        assert channel.doubled == count
    sync(channel, tpdo(7))
    assert (channel.doubled, channel.previous_extra) == (3, 1)
    sync(channel, tpdo(7))
    assert (channel.doubled, channel.previous_extra) == (0, 0)


def test_contradicting_tpdos_are_no_sample_until_a_single_one_comes(channel):
    sync(channel, tpdo(7))
    assert not sync(channel, tpdo(7), tpdo(900))
    assert not sync(channel, tpdo(8), tpdo(8))  # which of the two devices is unknown
    assert channel.position == 7
    sync(channel, tpdo(9))
    assert sync(channel, tpdo(10))
    assert channel.position == 10


def test_a_late_tpdo_beside_the_present_one_is_not_doubled(channel):
    sync(channel, tpdo(7))
    sync(channel)  # its TPDO comes after the next SYNC
    channel.close_cycle()
    channel.open_cycle()
    channel.take(tpdo(9), 1000)
    channel.take_extra(tpdo(8))
    assert channel.conclude()
    assert channel.position == 9
    sync(channel, tpdo(10))
    assert (channel.doubled, channel.ambiguous) == (0, False)


def test_a_reset_starts_a_new_account(channel):
    for _ in range(3):
        sync(channel, tpdo(7), tpdo(900))
    channel.reset()
    assert (channel.seen, channel.doubled, channel.ambiguous) == (False, 0, False)
    assert sync(channel, tpdo(8))


def test_the_controlwords_sent_are_listed_without_repetitions(channel):
    for word in (6, 7, 7, 15, 15, 6, 7):
        channel.controlword = word
        channel.pack()
    assert list(channel.sent_controlwords) == [7, 15, 6, 7]


def test_the_target_at_standstill_is_the_actual_position(channel):
    sync(channel, tpdo(-42))
    channel.offset = 3
    channel.stand_still()
    assert channel.pack() == struct.pack("<Hih", 0, -42, 0)
