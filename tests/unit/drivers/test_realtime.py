"""What is asked of the operating system, and what is made of a frame's time stamp."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from drivers.canopen import MonotonicClock, stamps_of
from drivers.cyclic import RealTime
from drivers.cyclic.realtime import SWITCH_INTERVAL
from drivers.errors import ConfigurationError
from drivers.settings import BusSettings, RealTimeSettings


def in_a_thread(function):
    """Scheduling belongs to a thread: this one's stays as it is."""
    result = []
    thread = threading.Thread(target=lambda: result.append(function()))
    thread.start()
    thread.join()
    return result[0]


def test_everything_that_was_granted_is_taken_back():
    def asked():
        before = os.sched_getscheduler(0), os.sched_getaffinity(0), sys.getswitchinterval()
        core = min(before[1])
        real_time = RealTime(RealTimeSettings(priority=2, core=core, lock_memory=True))
        real_time.begin()
        real_time.begin()  # once is enough
        during = os.sched_getscheduler(0), os.sched_getaffinity(0), sys.getswitchinterval()
        frozen = gc.get_freeze_count()
        real_time.end()
        after = os.sched_getscheduler(0), os.sched_getaffinity(0), sys.getswitchinterval()
        return before, during, after, frozen, real_time

    before, during, after, frozen, real_time = in_a_thread(asked)
    assert after == before
    assert during[1] == {min(before[1])}
    assert during[2] <= SWITCH_INTERVAL
    assert frozen > 0
    assert gc.get_freeze_count() == 0
    assert not real_time.active
    # the other two take a right that not everybody has: granted, or refused in a word
    told = real_time.granted + real_time.refused
    others = [t for t in real_time.refused if not t.endswith(": not permitted")]
    assert others in ([], ["memory lock: Cannot allocate memory"])  # beyond `ulimit -l`
    assert {t.partition(":")[0] for t in told} == {
        "SCHED_FIFO, priority 2", f"core {min(before[1])}", "memory lock",
    }  # fmt: skip
    fifo = during[0] & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    assert fifo is ("SCHED_FIFO, priority 2" in real_time.granted)


def test_a_core_that_is_not_there_is_refused_in_one_clause():
    def asked():
        real_time = RealTime(RealTimeSettings(core=1023))
        real_time.begin()
        real_time.end()
        return real_time.refused

    (refused,) = in_a_thread(asked)
    assert refused.startswith("core 1023: not among the cores 0")


def test_no_garbage_collection_in_motion_only():
    for frozen in (True, False):
        real_time = RealTime(RealTimeSettings(freeze_gc=frozen))
        with real_time.in_motion():
            assert gc.isenabled()  # not begun: nothing was asked for
        real_time.begin()
        try:
            with real_time.in_motion():
                assert gc.isenabled() is not frozen
            assert gc.isenabled()
        finally:
            real_time.end()


@pytest.mark.parametrize(
    ("settings", "name"), [({"priority": 100}, "priority"), ({"core": -1}, "core")]
)
def test_settings_that_do_not_exist(settings, name):
    with pytest.raises(ConfigurationError, match=f"realtime {name}"):
        RealTimeSettings(**settings)


@pytest.mark.parametrize(
    "settings",
    [{"sync_source": "nobody"}, {"sync_window": 2e-3}, {"max_late": -1}, {"sync_window": 1e-6}],
)
def test_bus_settings_that_do_not_exist(settings):
    with pytest.raises(ConfigurationError, match=next(iter(settings))):
        BusSettings("virtual", "x", **settings)


def bus_of(module, **attributes):
    return type("Bus", (), {"__module__": module, **attributes})()


def test_a_stamp_tells_how_long_a_frame_has_waited():
    arrived = stamps_of(bus_of("can.interfaces.socketcan.socketcan"))
    assert arrived is not None
    before, stamp, now = time.monotonic_ns(), time.time() - 0.25, time.monotonic_ns()
    assert before - 251_000_000 < arrived(stamp, now) < now - 249_000_000
    assert arrived(12.5, now) == now  # some other clock's
    assert arrived(time.time() + 60, now) == now
    assert not arrived.useless


def test_a_bus_that_stamps_nothing_is_known_after_some_frames():
    arrived = stamps_of(bus_of("can.interfaces.socketcan.socketcan"))
    assert arrived is not None
    for _ in range(200):
        now = time.monotonic_ns()
        assert arrived(0.0, now) == now
    assert arrived.useless


def test_other_clocks_stamps_are_not_believed():
    assert stamps_of(bus_of("can.interfaces.slcan")) is None
    assert stamps_of(bus_of("can.interfaces.virtual", clock=MonotonicClock())) is None
    assert stamps_of(SimpleNamespace()) is None
