"""A whole SYNC in one call, on a bus that delivers in its sender's thread.

The lock-step bus is one. When it has taken a frame, all that follows from it has happened: a SYNC,
from its setpoints to the TPDOs that it brings, needs neither waiting nor python-can's messages. The
frames, their times and the samples are those of python-can's interface.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, runtime_checkable

from drivers.canopen import Network
from drivers.cyclic.channel import Channel
from drivers.cyclic.reception import Receive, Reception
from drivers.objects import SYNC_ID


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


class DirectExchange:
    """Exchanges the data of SYNCs.

    Args:
        bus: delivers directly.
        network: on this bus.
        reception: of the channels.
    """

    def __init__(self, bus: DirectBus, network: Network, reception: Reception) -> None:
        self._bus, self._reception, self._network = bus, reception, network
        self._channels: Sequence[Channel] = reception.channels
        self._now_ns = network.clock.now_ns

    def try_sync(self, frames: Sequence[tuple[Channel, bytes]], due: int, recv: Receive) -> bool:
        """Sends setpoints at once, SYNC when it is due [ns], and takes what it brings.

        Returns:
            Whether SYNC was sent. If not, another frame came before it, such as a drive's
            heartbeat, or the bus has faults; the setpoints were sent.
        """
        channels, tap = self._channels, self._network.tap
        if tap is not None:
            now = self._now_ns()
            for channel, data in frames:
                tap(now, channel.rpdo_id, data)
        answers = self._bus.exchange(
            [(channel.rpdo_id, data) for channel, data in frames], due, SYNC_ID,
            [channel.tpdo for channel in channels],
        )  # fmt: skip
        if answers is None:
            return False
        if tap is not None:
            tap(due, SYNC_ID, b"")
        if answers:
            if tap is not None:
                for channel, data in zip(channels, answers, strict=True):
                    tap(due, channel.tpdo[0], data)
            self._reception.take(answers, due)
            return True
        for channel in channels:
            channel.close_cycle()
        self._reception.collect(recv, due)
        return True
