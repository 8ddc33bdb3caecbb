"""Virtual time that keeps to the wall clock: no instant comes before its time.

For people who watch: the simulation itself is the one of virtual time. A host that computes for
longer than a period is behind; the instants that it has missed then follow at once, up to
`CATCH_UP`, beyond which virtual time has stood still.
"""

from __future__ import annotations

import time
from collections import deque

from hil_sim.bus.world import World

KEPT = 100_000
LATE = 500_000
"""An instant that comes later than this counts as late [ns]."""
CATCH_UP = 50_000_000
"""Longest time made up for after a delay of the host [ns]."""


class PacedWorld(World):
    """A segment in virtual time whose clock is never ahead of the wall clock.

    Attributes:
        late: instants that came later than `LATE`, since the beginning.
        delays: by how much the latest instants came too late [ns].
        turnarounds: from the latest instants until the host waited for the next one [ns].
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._origin = self._released = time.monotonic_ns()
        self.late = 0
        self.delays: deque[int] = deque(maxlen=KEPT)
        self.turnarounds: deque[int] = deque(maxlen=KEPT)

    def _reach(self, instant: int) -> None:
        """As of a `World`, at its time by the wall clock [ns]."""
        now = time.monotonic_ns()
        self.turnarounds.append(now - self._released)
        ahead = self._origin + instant - now
        if ahead > 0:
            time.sleep(ahead * 1e-9)
            now = time.monotonic_ns()
        behind = now - self._origin - instant
        self.delays.append(behind)
        self.late += behind > LATE
        if behind > CATCH_UP:
            self._origin += behind - CATCH_UP
        self._released = now
        super()._reach(instant)
