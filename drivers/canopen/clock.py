"""The driver's clock, and whether frames of a bus carry the time of their arrival.

A bus may bring a clock in its attribute `clock`: that of the lock-step bus is virtual, and only
waiting advances it. Other buses get the monotonic clock. No other module here reads a real clock;
the times of arrival that frames bring are `stagedata.stamps`'.
"""

from __future__ import annotations

import time
from typing import Protocol, runtime_checkable

from stagedata.stamps import Stamps, is_stamped


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


def stamps_of(bus: object) -> Stamps | None:
    """Arrival times for the frames of a bus; None where it has a clock or stamps of its own."""
    if isinstance(getattr(bus, "clock", None), Clock):
        return None
    return Stamps() if is_stamped(bus) else None


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
