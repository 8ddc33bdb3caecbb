"""A bus that delivers in its sender's thread, and what it offers beside python-can's messages.

The lock-step bus is one. When it has taken a frame, all that follows from it has happened. So whole
SYNCs, from their setpoints to the TPDOs that they bring, need neither waiting nor messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, runtime_checkable


@runtime_checkable
class DirectBus(Protocol):
    """What such a bus offers, in step with `send` and `recv`."""

    def exchange(
        self,
        frames: Iterable[tuple[int, bytes]],
        at_ns: int,
        sync_id: int,
        expected: Sequence[tuple[int, int]],
    ) -> Sequence[bytes] | None:
        """Sends frames now and SYNC at `at_ns`, unless a frame comes before it.

        Args:
            frames: CAN-ID and data of each.
            at_ns: when to send SYNC, a data frame without data [ns].
            sync_id: its CAN-ID.
            expected: CAN-ID and number of bytes of each data frame that it is to cause, in order.

        Returns:
            The data of the frames expected, where these are all that SYNC has caused. Nothing where
            it has caused other ones, or fewer, or more: all of them wait for `recv`. None where
            SYNC was not sent: frames wait for `recv` before it, `at_ns` is past, or the bus has
            faults. Time is `at_ns` at most.
        """

    def exchange_block(
        self,
        rows: Sequence[Sequence[bytes]],
        ids: Sequence[int],
        grid_ns: tuple[int, int],
        sync_id: int,
        expected: Sequence[tuple[int, int, bytes]],
        answers: list[bytes],
    ) -> bool | None:
        """Sends rows of frames, each at once, and SYNC after each, as long as all is as expected.

        Args:
            rows: data of the frames before each SYNC.
            ids: CAN-IDs of the frames of a row.
            grid_ns: when to send the first SYNC, a data frame without data, and the time from each
                to the next [ns].
            sync_id: its CAN-ID.
            expected: CAN-ID, number of bytes and first bytes of each data frame that a SYNC is to
                cause, in order.
            answers: gets the data of these frames, SYNC by SYNC.

        Returns:
            True where all rows were exchanged. False where the last SYNC has caused other frames
            than expected, or fewer, or more: all of them wait for `recv`. None where the last row
            was sent without its SYNC: frames wait for `recv` before it, its time is past, or the
            bus has faults. Time is that of the last row's SYNC at most.
        """


def direct_bus(bus: object) -> DirectBus | None:
    """The bus itself where it is one that delivers directly."""
    return bus if isinstance(bus, DirectBus) else None
