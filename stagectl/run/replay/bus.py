"""A bus whose other participants are a log: gives the host what was received, checks what it sends.

Frames that the host sends have to be the log's, in their order and at their time; those that it
received come when all that it sent before has been sent, and their time has come. Time is virtual,
and the host's run was: of a run in real time a log has too little, for what the host did also
depended on when it read the clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import can

from stagectl.store import LoggedFrame


@dataclass(frozen=True, slots=True)
class Difference:
    """The first thing that the host did differently.

    Attributes:
        number: of the frame in the log, from 1.
        recorded: frame of the log, None where it ends there.
        sent: what the host sent instead, None where it sent nothing more.
    """

    number: int
    recorded: LoggedFrame | None
    sent: LoggedFrame | None


class ReplayClock:
    """Time of a replay [ns], 0 at the first frame."""

    __slots__ = ("_bus",)

    def __init__(self, bus: ReplayBus) -> None:
        self._bus = bus

    def now_ns(self) -> int:
        """The time now [ns]."""
        return self._bus.now_ns

    def sleep_until_ns(self, t: int) -> None:
        """Let time go by."""
        self._bus.wait_until(t)


class ReplayBus(can.BusABC):
    """The bus of a replay.

    Args:
        frames: of the log.
        complete: the log goes on to the end of the run (not of one that was killed).

    Attributes:
        now_ns: time of the replay [ns].
        clock: it, for the driver.
        difference: the first one, None so far.
        compared: frames of the host that were the same.
    """

    def __init__(self, frames: Sequence[LoggedFrame], complete: bool) -> None:
        super().__init__(channel="replay")
        self.channel_info = "replay"
        self.now_ns = 0
        self.clock = ReplayClock(self)
        self.difference: Difference | None = None
        self.compared = 0
        self._frames = frames
        self._complete = complete
        self._over = False
        self._received = self._next(-1, sent=False)
        self._sent = self._next(-1, sent=True)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Compare with the frame that the host sent then.

        Raises:
            can.CanOperationError: it is another one, the replay being over by that; or the bus
                failed there.
        """
        if self._over:
            raise can.CanOperationError("the replay is over")
        mine = LoggedFrame(self.now_ns, True, msg.arbitration_id, bytes(msg.data))
        at = self._sent
        if at >= len(self._frames):
            self._end(Difference(at + 1, None, mine) if self._complete else None)
        logged = self._frames[at]
        if logged != mine:
            self._end(Difference(at + 1, logged, mine))
        self.compared += 1
        self._sent = self._next(at, sent=True)
        if self._received == at + 1 and self._fails(self._received):
            self._fail()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame of the log that the host received, when its time has come."""
        if self._over:
            raise can.CanOperationError("the replay is over")
        wait = 0 if timeout is None or timeout <= 0 else round(timeout * 1e9)
        at = self._received
        if at < min(self._sent, len(self._frames)):
            frame = self._frames[at]
            if frame.time_ns <= self.now_ns + wait:
                self.now_ns = max(self.now_ns, frame.time_ns)
                if frame.failed:
                    self._fail()
                self._received = self._next(at, sent=False)
                return can.Message(
                    timestamp=self.now_ns * 1e-9,
                    arbitration_id=frame.can_id,
                    is_extended_id=frame.can_id > 0x7FF,
                    data=frame.data,
                )
        elif at >= len(self._frames) and self._sent >= len(self._frames) and not self._complete:
            self._end(None)
        self.now_ns += wait
        return None

    def wait_until(self, time_ns: int) -> None:
        """Let time go by."""
        self.now_ns = max(self.now_ns, time_ns)

    def finish(self) -> None:
        """The host has done all it does: what the log has besides is a difference."""
        if not self._over and self._complete and self._sent < len(self._frames):
            self.difference = Difference(self._sent + 1, self._frames[self._sent], None)

    def _next(self, at: int, sent: bool) -> int:
        """The next frame after `at` of this direction, or the end."""
        frames = self._frames
        at += 1
        while at < len(frames) and frames[at].sent is not sent:
            at += 1
        return at

    def _fails(self, at: int) -> bool:
        return at < len(self._frames) and self._frames[at].failed

    def _fail(self) -> None:
        self._received = self._next(self._received, sent=False)
        raise can.CanOperationError("the bus failed here when it was recorded")

    def _end(self, difference: Difference | None) -> None:
        self._over = True
        self.difference = difference
        raise can.CanOperationError("the replay is over")

    def _recv_internal(self, timeout: float | None) -> tuple[Any, bool]:
        raise NotImplementedError  # `recv` is overridden as a whole
