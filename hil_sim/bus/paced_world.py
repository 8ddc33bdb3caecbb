"""Virtual time that keeps to the wall clock: no instant comes before its time.

For people who watch: the simulation itself is the one of virtual time. A host that computes for
longer than a period is behind; the instants that it has missed then follow at once, up to
`CATCH_UP`, beyond which virtual time has stood still.
"""

from __future__ import annotations

import heapq
import time

from hil_sim.bus.world import World

CATCH_UP = 50_000_000
"""Longest time made up for after a delay of the host [ns]."""


class PacedWorld(World):
    """A segment in virtual time whose clock is never ahead of the wall clock.

    Attributes:
        behind_ns: by how much it was behind the wall clock at the last instant [ns].
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._origin = time.monotonic_ns()
        self.behind_ns = 0

    def step(self, deadline_ns: int | None) -> bool:
        """As of a `World`, at its time by the wall clock."""
        timers = self._timers
        while timers and timers[0][2].action is None:
            heapq.heappop(timers)
        instant = timers[0][0] if timers else deadline_ns
        if deadline_ns is not None and (instant is None or deadline_ns < instant):
            instant = deadline_ns
        if instant is not None:
            self._await(instant)
        return super().step(deadline_ns)

    def _await(self, instant: int) -> None:
        """Wait until an instant of virtual time [ns]."""
        ahead = self._origin + instant - time.monotonic_ns()
        if ahead > 0:
            time.sleep(ahead * 1e-9)
            ahead = self._origin + instant - time.monotonic_ns()
        self.behind_ns = max(0, -ahead)
        if self.behind_ns > CATCH_UP:
            self._origin += self.behind_ns - CATCH_UP
