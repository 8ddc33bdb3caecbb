"""What this machine offers a stage, finding by finding; `buses` are those of CAN buses."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from drivers.cyclic.realtime import RealTime
from drivers.settings import RealTimeSettings

NAMES = (
    "kernels", "real-time", "jitter", "socketcan", "kernel-sync", "vcan", "udp-multicast",
    "adapters", "postgres",
)  # fmt: skip
"""Of all findings, in order."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing.

    Attributes:
        name: one of `NAMES`.
        available: whether it can be used.
        found: what there is, in words.
        remedy: how to get what is missing; empty if nothing is.
    """

    name: str
    available: bool
    found: str
    remedy: str = ""


PERIOD = 1e-3
"""Of SYNC [s]."""
LATE = 0.5
"""Part of the period after which a SYNC counts as late."""
TOLERATED = 0.001
"""Share of late ones."""
PRIORITY = 50
"""That is asked for."""

_USUAL = RealTimeSettings(priority=PRIORITY, freeze_gc=False)
_PERIODS = (1e-3, 2e-3, 4e-3, 5e-3, 10e-3, 20e-3)
"""SYNC periods that are proposed [s]."""


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


def jitter_warning(period: float, realtime: RealTimeSettings, seconds: float = 0.5) -> str | None:
    """One line where this computer cannot keep a SYNC period by itself, with one that it can.

    Args:
        period: of SYNC [s].
        realtime: that the run will ask for.
        seconds: to measure for.
    """
    late = _lateness(seconds, realtime)

    def keeps(one: float) -> bool:
        return bool(np.count_nonzero(late > LATE * one) <= TOLERATED * len(late))

    if keeps(period):
        return None
    longer = next((one for one in _PERIODS if one > period and keeps(one)), None)
    proposed = "none up to 20 ms" if longer is None else f"bus.sync_period: {longer * 1e3:g} ms"
    return (
        f"this computer wakes up to {late.max() * 1e3:.2g} ms late, more than half of the SYNC "
        f"period of {period * 1e3:g} ms: it could keep {proposed} (stagectl doctor says more)"
    )


def _lateness(
    seconds: float, realtime: RealTimeSettings = _USUAL
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Of each waking [s]."""
    late = np.zeros(max(round(seconds / PERIOD), 1))

    def wake() -> None:
        asked = RealTime(realtime)
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


def examine_kernels() -> Finding:
    """Where compiled kernels are, how many, and for which processor."""
    import llvmlite.binding as llvm

    from stagedata.compiled import SHIPPED, kernel_folder

    kernels = kernel_folder()
    folder, problem = kernels.path, kernels.problem()
    shipped = len(list(SHIPPED.glob("*.kernel")))
    kept = list(folder.glob("*.kernel")) if problem is None else []
    size = sum(path.stat().st_size for path in kept)
    processor = os.environ.get("NUMBA_CPU_NAME") or f"{llvm.get_host_cpu_name()}, this very one"
    writable = problem is None and _is_writable(folder)
    remedy = state = ""
    if problem is not None:
        state = f", refused: {problem}"
        remedy = "set NUMBA_CACHE_DIR to a folder of yours that nobody else can write"
    elif not writable:
        state = ", not writable"
        remedy = "set NUMBA_CACHE_DIR to a folder that can be written: else every run compiles"
    elif not shipped and not kept:
        remedy = "nothing: the first run compiles for some 20 s, once"
    return Finding(
        "kernels", writable,
        f"{shipped} came with the installation, {len(kept)} were compiled here "
        f"({size / 1e6:.1f} MB in {folder}{state}); for {processor}",
        remedy,
    )  # fmt: skip


def examine_postgres() -> Finding:
    """Whether a history can be in PostgreSQL: the client's library, and a server's programs."""
    servers = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    server = f"server {servers[-1].parts[4]} installed" if servers else "no server installed here"
    if find_spec("psycopg") is None:
        return Finding(
            "postgres", False, f"psycopg is missing; {server}", "pip install 'stagectl[postgres]'"
        )
    return Finding("postgres", True, f"psycopg is installed; {server}")


def _is_writable(folder: Path) -> bool:
    while not folder.exists():
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK)


def examine(seconds: float) -> Iterator[Finding]:
    """Examine this machine; nothing is changed, and no frame is sent on a CAN bus.

    Args:
        seconds: to measure jitter for.
    """
    from stagectl.doctor import buses

    yield examine_kernels()
    yield examine_scheduling()
    yield examine_jitter(seconds)
    yield buses.examine_socketcan()
    yield buses.examine_kernel_sync()
    yield buses.examine_vcan()
    yield buses.examine_multicast()
    yield buses.examine_adapters()
    yield examine_postgres()
