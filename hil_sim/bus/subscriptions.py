"""Handlers by CAN-ID and actions at a time: what all segments have."""

from __future__ import annotations

import heapq
from collections.abc import Callable

Handler = Callable[[bytes], None]


class Subscriptions(dict[int, tuple[Handler, ...]]):
    """Handlers by CAN-ID, in the order of subscription."""

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this 11-bit id."""
        self[can_id] = (*self.get(can_id, ()), handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`; harmless if there is nothing to undo."""
        rest = tuple(h for h in self.get(can_id, ()) if h != handler)
        if rest:
            self[can_id] = rest
        else:
            self.pop(can_id, None)


class PendingAction:
    """An action at a given time, returned by a segment's `at`.

    Attributes:
        action: None once it has run or been cancelled.
    """

    __slots__ = ("action",)

    def __init__(self, action: Callable[[], None]) -> None:
        self.action: Callable[[], None] | None = action

    def cancel(self) -> None:
        """Cancel the action."""
        self.action = None


class Scheduler:
    """A segment's time, its timers, and the handlers of its nodes.

    Attributes:
        now_ns: time of the frame or timer being handled [ns], 0 when the segment was made.
    """

    def __init__(self) -> None:
        self.now_ns = 0
        self._timers: list[tuple[int, int, PendingAction]] = []
        self._timer_count = 0
        self._handlers = Subscriptions()

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this 11-bit id."""
        self._handlers.subscribe(can_id, handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        self._handlers.unsubscribe(can_id, handler)

    def at(self, time_ns: int, action: Callable[[], None]) -> PendingAction:
        """Call `action` at `time_ns`, or as soon as possible if that has passed."""
        timer = PendingAction(action)
        self._timer_count += 1  # equal times run in the order of these calls
        heapq.heappush(self._timers, (max(time_ns, self.now_ns), self._timer_count, timer))
        return timer
