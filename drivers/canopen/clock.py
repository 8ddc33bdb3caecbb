"""The time that the driver lives in: the bus's own where it has one, else the monotonic clock.

The lock-step bus brings a virtual clock in its attribute `clock`; there, only waiting moves time.
This is the one module of the package that reads a wall clock.
"""

from __future__ import annotations

import time
from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Integer nanoseconds from an arbitrary origin, never running backwards."""

    def now_ns(self) -> int:
        """The time now [ns]."""

    def sleep_until_ns(self, t: int) -> None:
        """Returns at `t` [ns] or as soon after as possible; at once when `t` is past."""


class MonotonicClock:
    """The operating system's monotonic clock; sleeps to absolute deadlines, so errors don't add."""

    __slots__ = ()

    def now_ns(self) -> int:
        """The time now [ns]."""
        return time.monotonic_ns()

    def sleep_until_ns(self, t: int) -> None:
        """Sleeps until `t` [ns]; returns at once when it is past."""
        # No spinning at the end: on few cores it takes the drives' time and worsens the p99.
        while (left := t - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)


STAMPED = ("socketcan", "udp_multicast", "virtual")
"""Interfaces of python-can whose time stamps are this computer's clock, taken on arrival."""
_OLDEST = 1_000_000_000
"""A frame that seems to have waited longer [ns] has another clock's stamp."""
_MANY = 100
"""Frames that say whether a bus stamps its frames."""
_LOOK_NS = 50_000_000
"""How often the two clocks are compared."""


class Stamps:
    """When frames came, by their stamps of the wall clock."""

    def __init__(self) -> None:
        self._apart, self._looked = _wall_ahead(), time.monotonic_ns()
        self._used = self._passed_over = 0

    def __call__(self, stamp: float, now: int) -> int:
        """The monotonic clock's time of arrival [ns].

        Args:
            stamp: python-can's [s].
            now: what the clock reads [ns]; also the answer where the stamp cannot be of this clock.
        """
        if now - self._looked > _LOOK_NS:  # the wall clock is slewed, or set
            self._apart, self._looked = _wall_ahead(), now
        at = int(stamp * 1e9) - self._apart
        if now - _OLDEST < at <= now:
            self._used += 1
            return at
        self._passed_over += 1
        return now

    @property
    def useless(self) -> bool:
        """Whether hardly any of many frames had a stamp that could be used."""
        return self._passed_over > _MANY and self._passed_over > 9 * self._used


def stamps_of(bus: object) -> Stamps | None:
    """How to tell when a frame of this bus came, however late it is read.

    Returns:
        None where the bus has its own clock, or stamps of one.
    """
    if isinstance(getattr(bus, "clock", None), Clock):
        return None
    if not any(f".{name}" in type(bus).__module__ for name in STAMPED):
        return None
    return Stamps()


def _wall_ahead() -> int:
    """By how much the wall clock is ahead of the monotonic one [ns]: the quickest look of a few.

    Something may come in between two looks; a quick one had nothing.
    """
    looks = []
    for _ in range(3):
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        looks.append((after - before, wall - (before + after) // 2))
    return min(looks)[1]


AT_ONCE = ("udp_multicast", "virtual")
"""Those of them whose receivers on this computer have a frame when `send` returns."""


def delivers_at_once(bus: object) -> bool:
    """Whether a frame has reached its receivers, or never will, when this bus's `send` returns.

    Of real CAN that is not true: the frame waits for its turn in the controller.
    """
    return stamps_of(bus) is not None and any(f".{n}" in type(bus).__module__ for n in AT_ONCE)


def clock_of(bus: object) -> Clock:
    """The clock of a python-can bus: its attribute `clock` where it offers one, else monotonic."""
    clock = getattr(bus, "clock", None)
    return clock if isinstance(clock, Clock) else MonotonicClock()
