"""SYNCs on a bus that delivers in its sender's thread: one, or a block of them, in one call.

The same frames at the same times, and the same samples, as one SYNC after the other by python-can's
interface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from drivers.canopen import DirectBus, FrameLog, Network, Tap
from drivers.cyclic.channel import Channel
from drivers.cyclic.reception import Receive, Reception
from drivers.objects import SYNC_ID

Rows = Sequence[Sequence[bytes]]
"""The RPDOs of all axes, SYNC by SYNC."""
Expected = Sequence[tuple[int, int, bytes]]
"""CAN-ID, number of bytes and first bytes of the TPDO of each axis."""


class DirectExchange:
    """Exchanges the data of SYNCs.

    Args:
        bus: delivers directly.
        network: on this bus.
        reception: of the channels.
        period_ns: Ts [ns].
    """

    def __init__(
        self, bus: DirectBus, network: Network, reception: Reception, period_ns: int
    ) -> None:
        self._bus, self._reception, self._log = bus, reception, _log_of(network.tap)
        self._channels: Sequence[Channel] = reception.channels
        self._tap, self._period = network.tap, period_ns
        self._sending = [c.axis.rpdo_id for c in self._channels]
        self._answering = [c.axis.tpdo_id for c in self._channels]
        self._now_ns = network.clock.now_ns

    def run_one(self, frames: Sequence[tuple[Channel, bytes]], due: int, recv: Receive) -> bool:
        """Sends setpoints at once, SYNC when it is due [ns], and takes what it brings.

        Returns:
            False where only the setpoints were sent: another frame came before SYNC, such as a
            drive's heartbeat, or the bus has faults.
        """
        channels, tap = self._channels, self._tap
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

    def run_block(
        self, rows: Rows, due: int, expected: Expected, answers: list[bytes], recv: Receive
    ) -> bool | None:
        """Sends setpoints at once, and SYNC after each row.

        Args:
            rows: to be sent.
            due: when the first SYNC is [ns].
            expected: of each SYNC.
            answers: gets the TPDOs of the SYNCs that have brought these and nothing else.
            recv: of the bus.

        Returns:
            True where all SYNCs have. Else the first one that has not is the last: False where it
            has been sent and received, None where only its setpoints have been sent.
        """
        channels, now = self._channels, self._now_ns()
        try:
            outcome = self._bus.exchange_block(
                rows, self._sending, (due, self._period), SYNC_ID, expected, answers
            )
        finally:
            done = len(answers) // len(channels)
            if self._log is not None:
                self._log(self._frames(rows, now, due, answers))
            if done:
                last = due + (done - 1) * self._period
                self._reception.take(answers[-len(channels) :], last)
        if outcome is False:
            last = due + done * self._period
            if self._log is not None:
                self._log((last, SYNC_ID, b""))
            for channel in channels:
                channel.close_cycle()
            self._reception.collect(recv, last)
        return outcome

    def _frames(self, rows: Rows, now: int, due: int, answers: list[bytes]) -> list[Any]:
        """All frames up to the last answers or setpoints sent, as `FrameLog.extend` takes them."""
        sending, answering = self._sending, self._answering
        frames: list[Any] = []
        at, end, period = 0, len(answers), self._period
        for row in rows:
            for can_id, data in zip(sending, row, strict=True):
                frames += (now, can_id, data)
            if at == end:
                break
            frames += (due, SYNC_ID, b"")
            for can_id in answering:
                frames += (due, can_id, answers[at])
                at += 1
            now, due = due, due + period
        return frames


def _log_of(tap: Tap | None) -> Callable[[Sequence[Any]], object] | None:
    """What takes any number of frames to this tap, as `FrameLog.extend` does."""
    if tap is None or isinstance(tap, FrameLog):
        return None if tap is None else tap.extend
    return lambda frames: [tap(*frames[k : k + 3]) for k in range(0, len(frames), 3)]
