"""The virtual stage in real time on any python-can bus: `stagectl sim`.

One thread: waits for a frame or the next timer, brings the plant to its time (the drives do that
themselves) and lets the drives handle it. A real drive samples when SYNC interrupts it; so a frame
is handled at the time it came where the bus tells that, and a late loop shows up as late answers,
never as samples of another instant. The control ticks keep in phase with SYNC, as real drives' do.
A SYNC that the next one has overtaken is not answered any more. Frames that the bus refuses are
lost, and counted. A bus that goes away is waited for where it can be opened again (`connection`).
"""

from __future__ import annotations

import heapq
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

import can

from hil_sim.bus.connection import Connection
from hil_sim.bus.subscriptions import Handler, PendingAction, Subscriptions
from hil_sim.stage import VirtualStage

_LONGEST_WAIT = 0.05  # s, how soon `stop` is noticed on a silent bus
_SYNC = 0x080
_STAMPED = ("socketcan", "udp_multicast", "virtual")  # interfaces with this computer's time stamps
_OLDEST = 1_000_000_000  # ns, a frame that seems older has another clock's stamp
_GAIN, _SLEW = 2e-3, 1_000  # of the lock on SYNC: per SYNC, and at most so much [ns]
_LOOK_NS = 50_000_000  # how often the two clocks are compared


class StopSignal(Protocol):
    """Such as `threading.Event`."""

    def is_set(self) -> bool:
        """Whether to stop."""


_new = object.__new__


class _Frame(can.Message):
    """A data frame of ours: python-can's `virtual` bus copies it field by field otherwise."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, object] | None) -> can.Message:
        copied: can.Message = _new(can.Message)  # the constructor takes twice as long
        copied.timestamp, copied.channel, copied.is_rx = self.timestamp, None, True
        copied.arbitration_id, copied.dlc, copied.data = self.arbitration_id, self.dlc, self.data[:]
        copied.is_extended_id = copied.is_remote_frame = copied.is_error_frame = False
        copied.is_fd = copied.bitrate_switch = copied.error_state_indicator = False
        return copied


class RealTimeSegment:
    """A python-can bus as the drives see it.

    Attributes:
        now_ns: time of the frame or timer being handled [ns], 0 when the segment was made.
        refused: frames that the bus did not take.
        sync_overtaken: the frame being handled is a SYNC, and the next one has come already.
        overtaken: how many of those there were.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Callable[[], int] = time.monotonic_ns,
        tick_ns: int = 0,
        reopen: Callable[[], can.BusABC | None] | None = None,
        told: Callable[[str], object] = lambda _: None,
    ) -> None:
        """With `tick_ns`, time is shifted until SYNCs come in the middle of a tick.

        `reopen` and `told` are those of `Connection`.
        """
        self.now_ns = 0
        self.refused = self.overtaken = 0
        self._connection = Connection(bus, reopen, told, clock)
        self._stamped = any(f".{name}" in type(bus).__module__ for name in _STAMPED)
        self._waiting: deque[tuple[int, int, bytes]] = deque()
        self.sync_overtaken = False
        self._clock = clock
        self._origin = clock()
        self._look_at_the_clock()
        self._tick_ns, self._gain = tick_ns, 1.0
        self._timers: list[tuple[int, int, PendingAction]] = []
        self._timer_count = 0
        self._handlers = Subscriptions()

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""
        frame = _Frame(arbitration_id=can_id, data=data, is_extended_id=False)
        if not self._connection.send(frame):
            self.refused += 1

    def at(self, time_ns: int, action: Callable[[], None]) -> PendingAction:
        """Call `action` at `time_ns`, or as soon as possible after."""
        timer = PendingAction(action)
        self._timer_count += 1
        heapq.heappush(self._timers, (time_ns, self._timer_count, timer))
        return timer

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this 11-bit id."""
        self._handlers.subscribe(can_id, handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        self._handlers.unsubscribe(can_id, handler)

    def close(self) -> None:
        """Close the bus, where it was up to us to open it again."""
        self._connection.close()

    def handle_next(self) -> None:
        """Wait for one frame or timer (not for ever) and handle what is due."""
        if not self._waiting:
            wait = _LONGEST_WAIT
            if self._timers:
                wait = min(wait, max(0.0, (self._timers[0][0] - self._elapsed()) * 1e-9))
            message = self._connection.recv(wait)
            while message is not None:  # what else is there: a SYNC may have been overtaken
                self._take(message)
                message = self._connection.recv(0.0)
        if self._waiting:
            came, can_id, data = self._waiting.popleft()
            self._run_timers(came)
            self.now_ns = max(self.now_ns, came)
            self.sync_overtaken = can_id == _SYNC and any(i == _SYNC for _, i, _ in self._waiting)
            self.overtaken += self.sync_overtaken
            if can_id == _SYNC and self._tick_ns:
                self._lock(came)
            for handler in self._handlers.get(can_id, ()):
                handler(data)
            self.sync_overtaken = False
        else:
            self._run_timers(self._elapsed())

    def _take(self, message: can.Message) -> None:
        if message.is_extended_id or message.is_remote_frame or message.is_error_frame:
            return
        now = self._elapsed()
        came = now
        if self._stamped:
            if now - self._looked > _LOOK_NS:
                self._look_at_the_clock()
            came = int(message.timestamp * 1e9) - self._wall
            if not now - _OLDEST < came <= now:
                came = now
        self._waiting.append((came, message.arbitration_id, bytes(message.data)))

    def _look_at_the_clock(self) -> None:
        """What the wall clock, which frames are stamped by, reads at our 0."""
        looks = []
        for _ in range(3):  # something may come in between: a quick look had nothing
            before, wall, after = self._clock(), time.time_ns(), self._clock()
            looks.append((after - before, wall - (before + after) // 2))
        self._wall = min(looks)[1] + self._origin
        self._looked = self._elapsed()

    def _lock(self, came: int) -> None:
        """Let the drives' control ticks follow SYNC, as a drive's phase-locked loop does.

        With SYNC in the middle of a tick, some jitter doesn't cost a tick: the demand would stand
        still for one.
        """
        away = came % self._tick_ns - self._tick_ns // 2
        self._gain = max(_GAIN, self._gain / (1.0 + self._gain))
        shift = max(-_SLEW, min(round(self._gain * away), _SLEW))
        self._origin += shift
        self._wall += shift

    def _run_timers(self, until: int) -> None:
        """All that is due until then, at its own time or now, whichever is later."""
        while self._timers and self._timers[0][0] <= until:
            due, _, timer = heapq.heappop(self._timers)
            self.now_ns = max(self.now_ns, due)
            if timer.action is not None:
                timer.action()
        self.now_ns = max(self.now_ns, until)

    def _elapsed(self) -> int:
        return self._clock() - self._origin


def serve(
    stage: VirtualStage,
    bus: can.BusABC,
    stop: StopSignal,
    reopen: Callable[[], can.BusABC | None] | None = None,
    told: Callable[[str], object] = lambda _: None,
) -> RealTimeSegment:
    """Run the stage's drives on `bus` until `stop` is set.

    Args:
        stage: not attached to a bus yet.
        bus: any python-can bus; this loop is its only reader.
        stop: `threading.Event` or alike.
        reopen: opens the bus again after it has failed, None while that can't be done. With it a
            bus that goes away is waited for, and is closed here in the end.
        told: called with a line when the bus goes, and when it is back.

    Returns:
        The segment, with its count of refused frames.

    Raises:
        can.CanError: the bus failed while receiving, and there is no `reopen`.
    """
    tick_ns = round(stage.settings.control_period * 1e9)
    segment = RealTimeSegment(bus, tick_ns=tick_ns, reopen=reopen, told=told)
    try:
        stage.attach(segment)
        while not stop.is_set():
            segment.handle_next()
    finally:
        segment.close()
    return segment
