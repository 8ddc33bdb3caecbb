"""Real-time requests to the operating system, and their withdrawal."""

import gc
import os
import sys
import threading

from drivers.cyclic import RealTime
from drivers.cyclic.realtime import SWITCH_INTERVAL
from drivers.settings import RealTimeSettings


def in_a_thread(function):
    """Scheduling belongs to a thread: this one's stays as it is."""
    result = []
    thread = threading.Thread(target=lambda: result.append(function()))
    thread.start()
    thread.join()
    return result[0]


def test_everything_that_was_granted_is_withdrawn():
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
    reported = real_time.granted + real_time.refused
    others = [t for t in real_time.refused if not t.endswith(": not permitted")]
    assert others in ([], ["memory lock: Cannot allocate memory"])  # beyond `ulimit -l`
    assert {t.partition(":")[0] for t in reported} == {
        "SCHED_FIFO, priority 2", f"core {min(before[1])}", "memory lock",
    }  # fmt: skip
    fifo = during[0] & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
    assert fifo is ("SCHED_FIFO, priority 2" in real_time.granted)


def test_a_core_that_does_not_exist_is_refused_in_one_clause():
    def asked():
        real_time = RealTime(RealTimeSettings(core=1023))
        real_time.begin()
        real_time.end()
        return real_time.refused

    (refused,) = in_a_thread(asked)
    assert refused.startswith("core 1023: not among the cores 0")


def test_garbage_collection_is_off_only_in_motion():
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
