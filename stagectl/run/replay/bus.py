"""A bus log as a bus: delivers the frames received then, and checks those that the host sends now.

The host's frames must equal the log's in content, order and time. A received frame is delivered
when its time has come and everything sent before it has been sent again. Time is virtual, as it
was in the run: a run in real time also depended on when the host read the clock, which no log has.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import can

from stagectl.errors import UnusableInput
from stagectl.store import LoggedFrame


@dataclass(frozen=True, slots=True)
class Difference:
    """The first frame that the host sent differently.

    Attributes:
        number: of the frame in the log, from 1.
        recorded: frame of the log; None where the log has ended.
        sent: frame of the host; None where it sent nothing more.
    """

    number: int
    recorded: LoggedFrame | None
    sent: LoggedFrame | None


class _Window:
    """The frames that a replay still needs, read from the log as it proceeds.

    Args:
        frames: of the log, in order.
        count: their number.
    """

    def __init__(self, frames: Iterator[LoggedFrame], count: int) -> None:
        self._frames, self._count = frames, count
        self._held: deque[LoggedFrame] = deque()
        self._first = 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, number: int) -> LoggedFrame:
        """A frame.

        Raises:
            UnusableInput: the log no longer reaches that far.
        """
        while number >= self._first + len(self._held):
            self._held.append(self._read())
        return self._held[number - self._first]

    def read_rest(self) -> None:
        """Read on to the end: only there it shows whether the log has changed.

        Raises:
            UnusableInput: it has.
        """
        for _ in range(self._first + len(self._held), self._count):
            self._read()
        if next(self._frames, None) is not None:
            raise UnusableInput(f"the bus log goes on after its last frame, {self._count}")

    def _read(self) -> LoggedFrame:
        frame = next(self._frames, None)
        if frame is None:
            raise UnusableInput(f"the bus log ends before its last frame, {self._count}")
        return frame

    def forget(self, before: int) -> None:
        """Drop the frames before this number."""
        while self._held and self._first < before:
            self._held.popleft()
            self._first += 1


class ReplayBus(can.BusABC):
    """The bus of a replay.

    Args:
        frames: of the log, taken as the replay proceeds.
        count: their number.
        complete: whether the log lasts to the end of the run; not if it was killed.

    Attributes:
        clock: for the driver: the bus itself.
        difference: the first one; None so far.
        compared: number of frames of the host that agreed.
    """

    def __init__(self, frames: Iterator[LoggedFrame], count: int, complete: bool) -> None:
        super().__init__(channel="replay")
        self.channel_info = "replay"
        self._now = 0
        self.clock = self
        self.difference: Difference | None = None
        self.compared = 0
        self._frames = _Window(frames, count)
        self._complete = complete
        self._over = False
        self._received = self._next(-1, sent=False)
        self._sent = self._next(-1, sent=True)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Compare a frame with the one sent then.

        Raises:
            can.CanOperationError: they differ, which ends the replay; or the bus failed there.
        """
        if self._over:
            raise can.CanOperationError("the replay is over")
        mine = LoggedFrame(self._now, True, msg.arbitration_id, bytes(msg.data))
        at = self._sent
        if at >= len(self._frames):
            self._end(Difference(at + 1, None, mine) if self._complete else None)
        logged = self._frames[at]
        if logged != mine:
            self._end(Difference(at + 1, logged, mine))
        self.compared += 1
        self._sent = self._next(at, sent=True)
        self._frames.forget(min(self._sent, self._received))
        if self._received == at + 1 < len(self._frames) and self._frames[at + 1].failed:
            self._fail()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame that the host received then, once its time has come."""
        if self._over:
            raise can.CanOperationError("the replay is over")
        wait = 0 if timeout is None or timeout <= 0 else round(timeout * 1e9)
        at = self._received
        if at < min(self._sent, len(self._frames)):
            frame = self._frames[at]
            if frame.time_ns <= self._now + wait:
                self._now = max(self._now, frame.time_ns)
                if frame.failed:
                    self._fail()
                self._received = self._next(at, sent=False)
                self._frames.forget(min(self._sent, self._received))
                return can.Message(
                    timestamp=self._now * 1e-9,
                    arbitration_id=frame.can_id,
                    is_extended_id=frame.can_id > 0x7FF,
                    data=frame.data,
                )
        elif at >= len(self._frames) and self._sent >= len(self._frames) and not self._complete:
            self._end(None)
        self._now += wait
        return None

    def now_ns(self) -> int:
        """Time of the replay [ns], 0 at the first frame."""
        return self._now

    def sleep_until_ns(self, t: int) -> None:
        """Advance to `t` [ns]."""
        self._now = max(self._now, t)

    def finish(self) -> None:
        """The host has finished: anything left in the log is a difference.

        Raises:
            UnusableInput: the log is no longer the one that was checked.
        """
        if not self._over and self._complete and self._sent < len(self._frames):
            self.difference = Difference(self._sent + 1, self._frames[self._sent], None)
        self._frames.read_rest()

    def _next(self, at: int, sent: bool) -> int:
        """Index of the next frame in this direction after `at`, or of the end."""
        frames = self._frames
        at += 1
        while at < len(frames) and frames[at].sent is not sent:
            at += 1
        return at

    def _fail(self) -> None:
        self._received = self._next(self._received, sent=False)
        raise can.CanOperationError("the bus failed here when it was recorded")

    def _end(self, difference: Difference | None) -> None:
        self._over = True
        self.difference = difference
        raise can.CanOperationError("the replay is over")
