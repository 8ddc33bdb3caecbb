"""A CAN segment in virtual time: clock, timers, nodes and hosts' receive queues, in one thread.

It has a clock in integer nanoseconds, a heap of timers, the nodes' handlers by CAN-ID and a queue
of frames that is drained before `transmit` returns: when a host has sent SYNC, every node has
answered it and nothing else has happened. Time moves only in `step` and `sleep_until_ns`.

Not modelled: bit times, arbitration (frames keep the order in which they are sent), bus errors.
Remote frames and extended ids reach the other hosts, but no node.
"""

from __future__ import annotations

import heapq
import weakref
from collections import deque
from collections.abc import Callable
from threading import get_ident

import can

from hil_sim.bus.subscriptions import Handler, Scheduler

Frame = tuple[int, int, bytes, tuple[bool, bool, bool], object]
"""Time [ns], id, data, (extended id, remote, error), sender (None for a node)."""

DATA_FRAME = (False, False, False)  # extended id, remote, error: the only frames nodes receive

_NOBODY: tuple[Handler, ...] = ()
_worlds: weakref.WeakValueDictionary[str, World] = weakref.WeakValueDictionary()


class World(Scheduler):
    """One CAN segment in virtual time.

    It belongs to the thread that made it. While referenced (by a bus or a node) it is registered
    under `name`, so that `can.Bus(interface="lockstep", channel=name)` finds it; a new world
    replaces an older one of the same name.

    Attributes:
        name: the channel.
        is_faultless: hosts may leave several steps to the bus (`LockstepBus.exchange`).
    """

    is_faultless = True

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self._thread = get_ident()
        self._frames: deque[Frame] = deque()
        self._queues: tuple[tuple[object, deque[Frame]], ...] = ()
        self._hosts: tuple[Callable[[Frame], None], ...] = ()  # receive the frames of nodes
        self._others: dict[object, tuple[Callable[[Frame], None], ...]] = {}
        self._delivering = False
        _worlds[name] = self

    @classmethod
    def get(cls, channel: object) -> World:
        """The world of this channel; a new one if there is none."""
        name = str(channel)  # can.Bus turns the channel "0" into an int
        world = _worlds.get(name)
        return cls(name) if world is None else world

    # Nodes -----------------------------------------------------------------------------------

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame from a node; one that is subscribed to the id receives it itself."""
        if not self._delivering:
            World.transmit(self, None, can_id, data)
            return
        frame = (self.now_ns, can_id, data, DATA_FRAME, None)
        if self._frames or can_id in self._handlers:
            self._frames.append(frame)
        else:  # only for hosts, and no frame is ahead of it
            for hand_to in self._hosts:
                hand_to(frame)

    # Hosts -----------------------------------------------------------------------------------

    def check_thread(self) -> None:
        """Raise unless called by the thread that owns this world's time.

        Raises:
            can.CanOperationError: for any other thread, such as a `can.Notifier`'s.
        """
        if get_ident() != self._thread:
            raise can.CanOperationError(
                f"lockstep bus {self.name!r}: used by a thread other than the one that made it "
                "(can.Notifier cannot be used: virtual time would run while it waits)"
            )

    def connect(self, owner: object, queue: deque[Frame]) -> None:
        """Append every frame from now on to `queue`, except those that `owner` sends."""
        self._set_queues((*self._queues, (owner, queue)))

    def disconnect(self, queue: deque[Frame]) -> None:
        """Undo `connect`."""
        self._set_queues(tuple(entry for entry in self._queues if entry[1] is not queue))

    def _set_queues(self, queues: tuple[tuple[object, deque[Frame]], ...]) -> None:
        self._queues = queues
        self._hosts = tuple(queue.append for _, queue in queues)
        self._others = {
            owner: tuple(queue.append for other, queue in queues if other is not owner)
            for owner, _ in queues
        }

    def transmit(
        self,
        owner: object,
        can_id: int,
        data: bytes,
        flags: tuple[bool, bool, bool] = DATA_FRAME,
    ) -> None:
        """Send a host's frame; deliver it and every frame that it causes."""
        frames, handlers_of = self._frames, self._handlers.get
        if self._delivering:
            frames.append((self.now_ns, can_id, data, flags, owner))
            return
        self._delivering = True
        try:
            while True:  # this frame, then those that its receivers send at once, in order
                for hand_to in self._others.get(owner, self._hosts):
                    hand_to((self.now_ns, can_id, data, flags, owner))
                if flags is DATA_FRAME:
                    for handler in handlers_of(can_id, _NOBODY):
                        handler(data)
                if not frames:
                    return
                _, can_id, data, flags, owner = frames.popleft()
        finally:
            self._delivering = False

    def step(self, deadline_ns: int | None) -> bool:
        """Move time to the next timer and run all timers of that instant.

        Args:
            deadline_ns: latest time [ns]; None: no limit.

        Returns:
            False if no timer was due until the deadline, which is now the time.

        Raises:
            can.CanOperationError: neither a deadline nor a timer.
        """
        timers = self._timers
        while timers and timers[0][2].action is None:
            heapq.heappop(timers)
        if not timers:
            if deadline_ns is None:
                raise can.CanOperationError(
                    f"lockstep bus {self.name!r}: waiting without limit, but no timer is pending"
                )
        elif deadline_ns is None or timers[0][0] <= deadline_ns:
            instant = timers[0][0]
            self._reach(instant)
            while timers and timers[0][0] <= instant:
                timer = heapq.heappop(timers)[2]
                action, timer.action = timer.action, None
                if action is not None:
                    action()
            return True
        if deadline_ns is not None:
            self._reach(deadline_ns)
        return False

    def _reach(self, instant: int) -> None:
        """Move time to an instant, unless that has passed [ns]."""
        self.now_ns = max(self.now_ns, instant)

    def sleep_until_ns(self, time_ns: int) -> None:
        """Let virtual time pass until `time_ns`, running every timer on the way."""
        self.check_thread()
        while self.step(time_ns):
            pass


class LockstepClock:
    """Virtual time of a world, in place of a monotonic clock."""

    __slots__ = ("_world",)

    def __init__(self, world: World) -> None:
        self._world = world

    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._world.now_ns

    def sleep_until_ns(self, time_ns: int) -> None:
        """Let virtual time pass until `time_ns` [ns]."""
        self._world.sleep_until_ns(time_ns)
