"""Handlers by CAN-ID, and actions at a time: shared by all segments."""

from __future__ import annotations

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
