"""A bus that delivers in its sender's thread, and what it offers beside python-can's messages.

The lock-step bus is one. When it has taken a frame, all that follows from it has happened. So a
whole SYNC, from its setpoints to the TPDOs that it brings, needs neither waiting nor messages.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable


@runtime_checkable
class DirectBus(Protocol):
    """What such a bus offers, in step with `send` and `recv`."""

    def transmit(self, can_id: int, data: bytes) -> None:
        """Sends a data frame, as `send`."""

    def exchange(
        self, at_ns: int, can_id: int, data: bytes, expected: Sequence[tuple[int, int]]
    ) -> Sequence[bytes] | None:
        """Lets time pass until `at_ns` and sends a data frame then, unless more would happen.

        Args:
            at_ns: when to send it [ns].
            can_id: of the frame.
            data: of the frame.
            expected: CAN-ID and number of bytes of each data frame that it is to cause, in order.

        Returns:
            The data of the frames expected, where these are all that it has caused. Nothing where
            it has caused other ones, or fewer, or more: all of them wait for `recv`. None where
            frames wait already, or anything else is due by then: nothing was done.
        """


def direct_bus(bus: object) -> DirectBus | None:
    """The bus itself where it is one that delivers directly."""
    return bus if isinstance(bus, DirectBus) else None
