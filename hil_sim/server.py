"""The virtual stage in real time on any python-can bus: `stagectl sim`.

One thread: waits for a frame or the next timer, brings the plant to the present (the drives do
that themselves) and lets the drives handle it. Frames are handled at the time they are read; a
late loop shows up as late answers, as on a busy drive. Frames that the bus refuses are lost, and
counted.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable
from typing import Protocol

import can

from hil_sim.stage import VirtualStage

Handler = Callable[[bytes], None]

_LONGEST_WAIT = 0.05  # s, how soon `stop` is noticed on a silent bus


class StopSignal(Protocol):
    """Such as `threading.Event`."""

    def is_set(self) -> bool:
        """Whether to stop."""


class _Frame(can.Message):
    """A data frame of ours: python-can's `virtual` bus copies it field by field otherwise."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, object] | None) -> can.Message:
        return can.Message(
            arbitration_id=self.arbitration_id, is_extended_id=False, data=bytes(self.data)
        )


class RealTimeTimer:
    """An action at a time; made by `RealTimeSegment.at`."""

    __slots__ = ("action",)

    def __init__(self, action: Callable[[], None]) -> None:
        self.action: Callable[[], None] | None = action

    def cancel(self) -> None:
        """Forget the action."""
        self.action = None


class RealTimeSegment:
    """A python-can bus as the drives see it.

    Attributes:
        now_ns: time of the frame or timer being handled [ns], 0 when the segment was made.
        refused: frames that the bus did not take.
    """

    def __init__(self, bus: can.BusABC, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.now_ns = 0
        self.refused = 0
        self._bus = bus
        self._clock = clock
        self._origin = clock()
        self._timers: list[tuple[int, int, RealTimeTimer]] = []
        self._timer_count = 0
        self._handlers: dict[int, tuple[Handler, ...]] = {}

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""
        try:
            self._bus.send(_Frame(arbitration_id=can_id, data=data, is_extended_id=False))
        except can.CanOperationError:
            self.refused += 1

    def at(self, time_ns: int, action: Callable[[], None]) -> RealTimeTimer:
        """Call `action` at `time_ns`, or as soon as possible after."""
        timer = RealTimeTimer(action)
        self._timer_count += 1
        heapq.heappush(self._timers, (time_ns, self._timer_count, timer))
        return timer

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this 11-bit id."""
        self._handlers[can_id] = (*self._handlers.get(can_id, ()), handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        self._handlers[can_id] = tuple(h for h in self._handlers.get(can_id, ()) if h != handler)

    def handle_next(self) -> None:
        """Wait for one frame or timer (not for ever) and handle what is due."""
        wait = _LONGEST_WAIT
        if self._timers:
            wait = min(wait, max(0.0, (self._timers[0][0] - self._elapsed()) * 1e-9))
        message = self._bus.recv(wait)
        self.now_ns = max(self.now_ns, self._elapsed())
        if message is not None and not (
            message.is_extended_id or message.is_remote_frame or message.is_error_frame
        ):
            data = bytes(message.data)
            for handler in self._handlers.get(message.arbitration_id, ()):
                handler(data)
        while self._timers and self._timers[0][0] <= self.now_ns:
            action = heapq.heappop(self._timers)[2].action
            if action is not None:
                action()

    def _elapsed(self) -> int:
        return self._clock() - self._origin


def serve(stage: VirtualStage, bus: can.BusABC, stop: StopSignal) -> RealTimeSegment:
    """Run the stage's drives on `bus` until `stop` is set.

    Args:
        stage: not attached to a bus yet.
        bus: any python-can bus; this loop is its only reader.
        stop: `threading.Event` or alike.

    Returns:
        The segment, with its count of refused frames.

    Raises:
        can.CanOperationError: the bus failed while receiving.
    """
    segment = RealTimeSegment(bus)
    stage.attach(segment)
    while not stop.is_set():
        segment.handle_next()
    return segment
