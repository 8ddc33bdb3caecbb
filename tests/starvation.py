"""Whether the machine was there while a test ran in real time.

A thread per processor, pinned to it and first in line where that is permitted, sleeps for a few
milliseconds at a time and tells when it wakes late. It lives in a process of its own: what our code
does to its interpreter is none of the machine's fault.

    python starvation.py    # the watch itself: a line "CORE WHEN HOW_LONG" [s] for each late waking
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass

NAP, LATE = 5e-3, 2e-3
"""How long it sleeps, and what is no news [s]."""
PRIORITY = 60
"""Above all that the tests ask for: who waits behind them has not been left by the machine."""
AWAY = 5e-3
"""A machine that was away for longer [s] has taken more than a SYNC period of most tests."""
SHARE = 0.01
"""Likewise one that was away, in many short times, for more of a test than this."""


class DisturbedError(Exception):
    """A test in real time failed, and the machine was away meanwhile: no evidence either way."""


@dataclass(frozen=True)
class Absence:
    """What the machine kept a test waiting.

    Attributes:
        longest: at one time [s].  share: of the time, on the processor that had the least.
    """

    longest: float
    share: float

    @property
    def matters(self) -> bool:
        """Whether a test in real time may have failed for no other reason."""
        return self.longest > AWAY or self.share > SHARE

    def __str__(self) -> str:
        return (
            f"the machine was away for up to {self.longest * 1e3:.0f} ms at a time, "
            f"{self.share:.1%} in all"
        )


class Watch:
    """The watch's process; `since` tells what it saw."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-S", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self._process.stdout is not None
        self._told = self._process.stdout.fileno()
        assert self._process.stdout.readline() == b"ready\n"
        os.set_blocking(self._told, False)

    def forget(self) -> float:
        """Now [s], for `since`; what was seen before is dropped."""
        self._read()
        return time.monotonic()

    def since(self, begin: float) -> Absence:
        """All that it saw since `begin`."""
        time.sleep(2 * NAP)  # an absence that goes on is reported when it ends
        end = time.monotonic()
        longest, lost = 0.0, dict.fromkeys(range(os.cpu_count() or 1), 0.0)
        for line in self._read().splitlines():
            core, at, late = line.split()
            if float(at) > begin:
                longest = max(longest, float(late))
                lost[int(core)] = lost.get(int(core), 0.0) + float(late)
        return Absence(longest, max(lost.values()) / (end - begin))

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(60)

    def _read(self) -> bytes:
        parts = []
        with contextlib.suppress(BlockingIOError):
            while part := os.read(self._told, 65536):
                parts.append(part)
        return b"".join(parts)


def _look(core: int) -> None:
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, {core})
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    while True:
        due = time.monotonic() + NAP
        time.sleep(NAP)
        now = time.monotonic()
        if now - due > LATE:
            with contextlib.suppress(BlockingIOError):  # nobody has been reading: old news
                os.write(1, f"{core} {now:.6f} {now - due:.6f}\n".encode())


def main() -> None:
    """Watch until stdin is closed."""
    os.set_blocking(1, False)
    os.write(1, b"ready\n")
    for core in sorted(os.sched_getaffinity(0)):
        threading.Thread(target=_look, args=(core,), daemon=True).start()
    sys.stdin.read()


if __name__ == "__main__":
    main()
