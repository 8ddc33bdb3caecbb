"""Arrival times from time stamps of this computer's wall clock, and of other clocks."""

import time

from stagedata.stamps import Stamps


def test_the_time_stamp_gives_the_time_of_arrival():
    arrived = Stamps()
    before, stamp, now = time.monotonic_ns(), time.time() - 0.25, time.monotonic_ns()
    assert before - 251_000_000 < arrived(stamp, now) < now - 249_000_000
    assert arrived(12.5, now) == now  # some other clock's
    assert arrived(time.time() + 60, now) == now
    assert not arrived.useless


def test_a_bus_without_time_stamps_is_recognized_after_some_frames():
    arrived = Stamps()
    for _ in range(200):
        now = time.monotonic_ns()
        assert arrived(0.0, now) == now
    assert arrived.useless
