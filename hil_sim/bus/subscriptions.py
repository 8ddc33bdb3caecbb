"""Who listens to which CAN-ID, and actions that wait for their time: shared by all segments."""

from __future__ import annotations

from collections.abc import Callable

Handler = Callable[[bytes], None]


class Subscriptions(dict[int, tuple[Handler, ...]]):
    """CAN-ID -> handlers, in the order in which they subscribed."""

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this 11-bit id."""
        self[can_id] = (*self.get(can_id, ()), handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`; harmless when it was not subscribed."""
        rest = tuple(h for h in self.get(can_id, ()) if h != handler)
        if rest:
            self[can_id] = rest
        else:
            self.pop(can_id, None)


class PendingAction:
    """An action at a time; what a segment's `at` returns.

    Attributes:
        action: None when it has run or was cancelled.
    """

    __slots__ = ("action",)

    def __init__(self, action: Callable[[], None]) -> None:
        self.action: Callable[[], None] | None = action

    def cancel(self) -> None:
        """Forget the action."""
        self.action = None
