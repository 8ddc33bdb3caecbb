"""Real-time requests to the operating system: SCHED_FIFO, one core, locked memory; no GC in motion.

All are optional, the first three need Linux. What is not permitted or not available is reported
in one clause (`refused`). They apply to the thread that calls `begin`.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from drivers.settings import RealTimeSettings

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # mlockall
_TIMER_SLACK = 29  # prctl
SWITCH_INTERVAL = 0.5e-3
"""How long another Python thread may keep the interpreter from the SYNC thread [s]."""


class RealTime:
    """The requests of a session, withdrawn at its end.

    Attributes:
        granted: requests in force, in words.  refused: those that are not, with the reason.
    """

    def __init__(self, settings: RealTimeSettings) -> None:
        self.settings = settings
        self.granted: tuple[str, ...] = ()
        self.refused: tuple[str, ...] = ()
        self._undo: list[Callable[[], object]] = []

    @property
    def active(self) -> bool:
        """Whether this is between `begin` and `end`."""
        return bool(self._undo)

    def begin(self) -> None:
        """Makes all requests; does nothing when they have been made."""
        if self.active:
            return
        s, granted, refused = self.settings, [], []
        interval = sys.getswitchinterval()
        sys.setswitchinterval(min(interval, SWITCH_INTERVAL))
        self._undo.append(lambda: sys.setswitchinterval(interval))
        self._short_timer_slack()
        for wanted, name, ask in (
            (s.priority > 0, f"SCHED_FIFO, priority {s.priority}", self._fifo),
            (s.core is not None, f"core {s.core}", self._pin),
            (s.lock_memory, "memory lock", self._lock),
        ):
            if not wanted:
                continue
            try:
                ask()
            except PermissionError:
                refused.append(f"{name}: not permitted")
            except (AttributeError, NotImplementedError):
                refused.append(f"{name}: not offered by this system")
            except OSError as why:
                refused.append(f"{name}: {why.strerror or why}")
            else:
                granted.append(name)
        if s.freeze_gc:
            gc.collect()
            gc.freeze()
            self._undo.append(gc.unfreeze)
        self.granted, self.refused = tuple(granted), tuple(refused)

    def end(self) -> None:
        """Withdraws all requests."""
        while self._undo:
            try:
                self._undo.pop()()
            except OSError:  # the former state no longer exists: a core taken offline, for instance
                continue

    @contextmanager
    def in_motion(self) -> Iterator[None]:
        """Suspends garbage collection, where the settings ask for that."""
        if not (self.active and self.settings.freeze_gc and gc.isenabled()):
            yield
            return
        gc.disable()
        try:
            yield
        finally:
            gc.enable()

    def _fifo(self) -> None:
        policy, param = os.sched_getscheduler(0), os.sched_getparam(0)
        # not inherited by threads and processes
        own = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, own, os.sched_param(self.settings.priority))
        self._undo.append(lambda: os.sched_setscheduler(0, policy, param))

    def _pin(self) -> None:
        core, before = self.settings.core, os.sched_getaffinity(0)
        if core is None or core not in before:
            raise OSError(None, f"not among the cores {', '.join(map(str, sorted(before)))}")
        os.sched_setaffinity(0, {core})
        self._undo.append(lambda: os.sched_setaffinity(0, before))

    def _lock(self) -> None:
        libc = _libc()
        # on fault: pages never touched (thread stacks, arenas) need no RAM
        if libc.mlockall(_CURRENT | _FUTURE | _ON_FAULT):
            code = ctypes.get_errno()
            raise OSError(code, os.strerror(code))
        self._undo.append(libc.munlockall)

    def _short_timer_slack(self) -> None:
        """Lets sleeps end within 1 us of their time instead of 50 us; needs no privilege."""
        try:
            libc = _libc()
            before = int(libc.prctl(30))  # PR_GET_TIMERSLACK
            if before > 0 and libc.prctl(_TIMER_SLACK, ctypes.c_ulong(1000)) == 0:
                self._undo.append(lambda: libc.prctl(_TIMER_SLACK, ctypes.c_ulong(before)))
        except (AttributeError, NotImplementedError):
            return


def _libc() -> ctypes.CDLL:
    if not sys.platform.startswith("linux"):
        raise NotImplementedError
    return ctypes.CDLL(None, use_errno=True)
