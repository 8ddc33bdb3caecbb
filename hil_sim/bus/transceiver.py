"""One node's connection to a bus with faults: frames it misses, and bus-off."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from hil_sim.bus.fault_rules import FaultyLine
from hil_sim.bus.subscriptions import Handler, PendingAction, Subscriptions
from hil_sim.bus.world import World


class Transceiver:
    """A `CanSegment` for one node.

    Args:
        world: the bus.
        node: node id.
        send: takes id and data of a frame of the node.
        line: carries the frames to the node; None: directly.

    Attributes:
        bus_off: the node neither sends nor receives.
    """

    def __init__(
        self,
        world: World,
        node: int,
        send: Callable[[int, bytes], None],
        line: FaultyLine | None,
    ) -> None:
        self.bus_off = False
        self._world = world
        self._node = node
        self._send = send
        self._line = line
        self._handlers = Subscriptions()
        self._subscribed: set[int] = set()

    @property
    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._world.now_ns

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""
        if not self.bus_off:
            self._send(can_id, data)

    def at(self, time_ns: int, action: Callable[[], None]) -> PendingAction:
        """Call `action` at `time_ns`."""
        return self._world.at(time_ns, action)

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this id."""
        if can_id not in self._subscribed:
            self._subscribed.add(can_id)
            self._world.subscribe(can_id, partial(self._receive, can_id))
        self._handlers.subscribe(can_id, handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        self._handlers.unsubscribe(can_id, handler)

    def deliver(self, can_id: int, data: bytes) -> None:
        """Deliver a frame to the node, whatever the faults."""
        for handler in self._handlers.get(can_id, ()):
            handler(data)

    def _receive(self, can_id: int, data: bytes) -> None:
        if self.bus_off:
            return
        if self._line is None:
            self.deliver(can_id, data)
        else:
            self._line.carry(can_id, data, self._node, partial(self.deliver, can_id))
