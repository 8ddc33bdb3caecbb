"""How punctual a thread is that wakes once per SYNC period, as the one that sends SYNC."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from drivers.cyclic.realtime import RealTime
from drivers.settings import RealTimeSettings
from stagectl.doctor.finding import Finding

PERIOD = 1e-3
"""Of SYNC [s]."""
LATE = 0.5
"""Part of the period after which a SYNC counts as late."""
TOLERATED = 0.001
"""Share of late ones."""
PRIORITY = 50
"""That is asked for."""


def examine_scheduling() -> Finding:
    """Whether real-time scheduling and locked memory are granted."""
    asked = RealTime(RealTimeSettings(priority=PRIORITY, lock_memory=True, freeze_gc=False))

    def ask() -> None:
        asked.begin()
        asked.end()

    _in_a_thread(ask)
    granted = ", ".join(asked.granted) or "neither SCHED_FIFO nor locked memory"
    return Finding(
        "real-time", not asked.refused, "; ".join((granted, *asked.refused)),
        "in /etc/security/limits.d/stagectl.conf: '@GROUP - rtprio 80' and '@GROUP - memlock "
        "unlimited', then log in again" if asked.refused else "",
    )  # fmt: skip


def examine_jitter(seconds: float) -> Finding:
    """How late a thread wakes, with what scheduling is granted.

    Args:
        seconds: to measure for.
    """
    late = _lateness(seconds) * 1e6
    worst, limit = float(late.max()), LATE * PERIOD * 1e6
    missed = int(np.count_nonzero(late > limit))
    return Finding(
        "jitter", missed <= TOLERATED * len(late),
        f"woken {np.median(late):.0f} µs late (median), {np.percentile(late, 99):.0f} µs (99 %), "
        f"{worst:.0f} µs (worst of {len(late)}) at a SYNC period of {PERIOD * 1e3:g} ms; "
        f"{missed} more than half a period",
        "real-time scheduling (above), bus.realtime in the machine file (priority, core), a kernel "
        "with PREEMPT_RT, less other work on this machine; or SYNC by the kernel (below)"
        if missed else "",
    )  # fmt: skip


def _lateness(seconds: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Of each waking [s]."""
    late = np.zeros(max(round(seconds / PERIOD), 1))

    def wake() -> None:
        asked = RealTime(RealTimeSettings(priority=PRIORITY, freeze_gc=False))
        asked.begin()
        due = time.perf_counter()
        for k in range(len(late)):
            due += PERIOD
            time.sleep(max(due - time.perf_counter(), 0.0))
            now = time.perf_counter()
            late[k] = now - due
            due = max(due, now - PERIOD)  # what has passed is skipped, as SYNC is
        asked.end()

    _in_a_thread(wake)
    return late


def _in_a_thread(job: Callable[[], None]) -> None:
    """Scheduling belongs to a thread: not to this one."""
    thread = threading.Thread(target=job)
    thread.start()
    thread.join()
