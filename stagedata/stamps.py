"""Arrival times of a bus' frames on the monotonic clock, from their wall-clock time stamps."""

from __future__ import annotations

import time

STAMPED = ("socketcan", "udp_multicast", "virtual")
"""python-can interfaces that stamp frames on arrival with this computer's wall clock."""
_MAX_AGE_NS = 1_000_000_000
"""A time stamp older than this cannot be from this computer's wall clock."""
_ENOUGH = 100
"""Unusable time stamps after which a bus is treated as having none."""
_COMPARE_NS = 50_000_000
"""How often wall clock and monotonic clock are compared."""


class Stamps:
    """Arrival times of frames, from their wall-clock time stamps."""

    def __init__(self) -> None:
        self._offset, self._compared = _wall_ahead(), time.monotonic_ns()
        self._used = self._unusable = 0

    def __call__(self, stamp: float, now: int) -> int:
        """The time of arrival on the monotonic clock [ns].

        Args:
            stamp: python-can's time stamp [s].
            now: the present time [ns]; returned where the stamp cannot be of this clock.
        """
        if now - self._compared > _COMPARE_NS:  # the wall clock may be slewed or set
            self._offset, self._compared = _wall_ahead(), now
        at = int(stamp * 1e9) - self._offset
        if now - _MAX_AGE_NS < at <= now:
            self._used += 1
            return at
        self._unusable += 1
        return now

    @property
    def useless(self) -> bool:
        """Whether hardly any of many frames had a usable stamp."""
        return self._unusable > _ENOUGH and self._unusable > 9 * self._used


def is_stamped(bus: object) -> bool:
    """Whether a python-can bus stamps frames with this computer's wall clock."""
    return any(f".{name}" in type(bus).__module__ for name in STAMPED)


def _wall_ahead() -> int:
    """By how much the wall clock is ahead of the monotonic clock [ns].

    Takes the fastest of three readings, the one least disturbed by other threads.
    """
    readings = []
    for _ in range(3):
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        readings.append((after - before, wall - (before + after) // 2))
    return min(readings)[1]
