"""The driver's clock, and arrival times from the time stamps of frames.

A bus may bring a clock in its attribute `clock`: that of the lock-step bus is virtual, and only
waiting advances it. Other buses get the monotonic clock. No other module here reads a real clock.
"""

from __future__ import annotations

import time
from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Integer nanoseconds from an arbitrary origin, never running backwards."""

    def now_ns(self) -> int:
        """The present time [ns]."""

    def sleep_until_ns(self, t: int) -> None:
        """Returns at `t` [ns] or as soon after as possible; at once when `t` is past."""


class MonotonicClock:
    """The monotonic clock; sleeps until absolute times, so that errors do not accumulate."""

    __slots__ = ()

    def now_ns(self) -> int:
        """The present time [ns]."""
        return time.monotonic_ns()

    def sleep_until_ns(self, t: int) -> None:
        """Sleeps until `t` [ns]; returns at once when it is past."""
        # no spinning at the end: on few cores that delays the drives
        while (left := t - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)


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


def stamps_of(bus: object) -> Stamps | None:
    """Arrival times for the frames of a bus; None where it has a clock or stamps of its own."""
    if isinstance(getattr(bus, "clock", None), Clock):
        return None
    if not any(f".{name}" in type(bus).__module__ for name in STAMPED):
        return None
    return Stamps()


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


AT_ONCE = ("udp_multicast", "virtual")
"""Interfaces whose receivers on this computer have a frame when `send` returns."""


def delivers_at_once(bus: object) -> bool:
    """Whether receivers have a frame when this bus's `send` returns, unless it is lost.

    Not so on real CAN, where frames wait for arbitration in the controller.
    """
    return stamps_of(bus) is not None and any(f".{n}" in type(bus).__module__ for n in AT_ONCE)


def clock_of(bus: object) -> Clock:
    """The clock of a python-can bus: its attribute `clock` if present, else the monotonic clock."""
    clock = getattr(bus, "clock", None)
    return clock if isinstance(clock, Clock) else MonotonicClock()
