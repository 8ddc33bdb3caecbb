"""Standstill of all axes: waiting for it, and braking by the halt bit (0x6040, bit 8)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from drivers.cyclic import Channel, Cycle
from drivers.drive import Control, State
from drivers.motion.fault_report import axis_fault

REST_SYNCS = 20
REST_BAND = 50e-9
"""An axis is at rest when it stays within this band [m] for `REST_SYNCS`."""


def wait_for_rest(cycle: Cycle, timeout: float) -> None:
    """Waits until all axes are at rest, at most `timeout` [s]."""
    recent: deque[tuple[int, ...]] = deque(maxlen=REST_SYNCS)
    for _ in cycle.cycles(timeout, checked=False):
        recent.append(tuple(c.position for c in cycle.channels))
        if len(recent) == REST_SYNCS and not _moved(cycle, recent):
            return


def halt(cycle: Cycle, timeout: float) -> None:
    """Halts all enabled axes by controlword bit 8; they hold where they come to rest.

    Raises:
        AxisFault: an axis faults, or still moves after `timeout` [s].
        BusError: the bus fails.
    """
    brake(cycle, timeout)
    for channel in cycle.channels:
        channel.stand_still()
        channel.controlword &= ~int(Control.HALT)
    cycle.sync.resume()
    cycle.exchange()


def brake(cycle: Cycle, timeout: float) -> None:
    """Brakes all axes by controlword bit 8, which stays set; raises as `halt`."""
    recent: deque[tuple[int, ...]] = deque(maxlen=REST_SYNCS)
    for channel in cycle.channels:
        channel.controlword |= int(Control.HALT)
        channel.offset = 0
    for _ in cycle.cycles(timeout):
        recent.append(tuple(c.position for c in cycle.channels))
        for channel in cycle.channels:
            if channel.valid and channel.state is not State.OPERATION_ENABLED:
                raise axis_fault(channel, "left OPERATION ENABLED during a halt")
        still = len(recent) == REST_SYNCS and not _moved(cycle, recent)
        # bit 10 (velocity 0 with halt) is not required: not all drives have it
        if still and all(c.valid for c in cycle.channels):
            return
    moving = _moved(cycle, recent) or cycle.channels
    raise axis_fault(moving[0], f"still moves {timeout:g} s after halt")


def _moved(cycle: Cycle, recent: Iterable[tuple[int, ...]]) -> list[Channel]:
    """Axes that left the rest band in these positions [increments]."""
    return [
        c
        for p, c in zip(zip(*recent, strict=True), cycle.channels, strict=True)
        if max(p) - min(p) > REST_BAND / c.axis.increment
    ]
