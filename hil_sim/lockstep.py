"""A CAN bus in virtual time, delivered synchronously in one thread (python-can `lockstep`).

`World` is the segment: an integer-nanosecond clock, a heap of timers, the nodes' handlers by
CAN id and a queue of frames that is drained before `send` returns. A SYNC sent by the host has
been answered by every node when `send` comes back, and nothing else has happened. Only waiting
moves time: `recv` with a timeout, and `bus.clock.sleep_until_ns`.

Not modelled: bit times and arbitration (frames keep the order they were sent in), bus errors,
remote frames and extended ids towards the nodes (they reach the other hosts only).
"""

from __future__ import annotations

import heapq
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from threading import get_ident
from typing import Any

import can
from can.broadcastmanager import (
    CyclicSendTaskABC,
    LimitedDurationCyclicSendTaskABC,
    ModifiableCyclicTaskABC,
    RestartableCyclicTaskABC,
)

Handler = Callable[[bytes], None]

_DATA_FRAME = (False, False, False)  # extended id, remote, error: what nodes listen to

_worlds: weakref.WeakValueDictionary[str, World] = weakref.WeakValueDictionary()


class WorldTimer:
    """An action at a time; made by `World.at`."""

    __slots__ = ("action",)

    def __init__(self, action: Callable[[], None]) -> None:
        self.action: Callable[[], None] | None = action

    def cancel(self) -> None:
        """Forget the action."""
        self.action = None


class World:
    """One CAN segment in virtual time.

    It belongs to the thread that made it. Registered under `name` for as long as somebody holds
    it (a bus or a node does), so that `can.Bus(interface="lockstep", channel=name)` finds it; a
    new world takes the name over from an older one.

    Attributes:
        name: the channel.
        now_ns: virtual time [ns], from 0.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.now_ns = 0
        self._thread = get_ident()
        self._timers: list[tuple[int, int, WorldTimer]] = []
        self._timer_count = 0
        self._handlers: dict[int, tuple[Handler, ...]] = {}
        self._frames: deque[_Frame] = deque()
        self._queues: tuple[tuple[object, deque[_Frame]], ...] = ()
        self._delivering = False
        _worlds[name] = self

    @classmethod
    def get(cls, channel: object) -> World:
        """The world of this channel, a new and empty one if there is none."""
        name = str(channel)  # can.Bus turns the channel "0" into an int
        world = _worlds.get(name)
        return cls(name) if world is None else world

    # Nodes -----------------------------------------------------------------------------------

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this 11-bit id."""
        self._handlers[can_id] = (*self._handlers.get(can_id, ()), handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        rest = tuple(h for h in self._handlers.get(can_id, ()) if h != handler)
        if rest:
            self._handlers[can_id] = rest
        else:
            self._handlers.pop(can_id, None)

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame from a node. A node that listens to its own id hears itself."""
        self._frames.append((self.now_ns, can_id, data, _DATA_FRAME, None))
        if not self._delivering:
            self._deliver()

    def at(self, time_ns: int, action: Callable[[], None]) -> WorldTimer:
        """Call `action` when virtual time reaches `time_ns` (at the next wait if it has)."""
        timer = WorldTimer(action)
        self._timer_count += 1  # equal times run in the order they were asked for
        heapq.heappush(self._timers, (max(time_ns, self.now_ns), self._timer_count, timer))
        return timer

    # Hosts -----------------------------------------------------------------------------------

    def check_thread(self) -> None:
        """Raise unless called by the thread that owns this world's time.

        Raises:
            can.CanOperationError: for any other thread, such as a `can.Notifier`'s.
        """
        if get_ident() != self._thread:
            raise can.CanOperationError(
                f"lockstep bus {self.name!r}: used by another thread than the one that made it "
                "(no can.Notifier here: its waiting would run virtual time away)"
            )

    def connect(self, owner: object, queue: deque[_Frame]) -> None:
        """Append every frame from now on to `queue`; `owner` is told its own frames apart by."""
        self._queues = (*self._queues, (owner, queue))

    def disconnect(self, queue: deque[_Frame]) -> None:
        """Undo `connect`."""
        self._queues = tuple(entry for entry in self._queues if entry[1] is not queue)

    def transmit(
        self,
        owner: object,
        can_id: int,
        data: bytes,
        flags: tuple[bool, bool, bool] = _DATA_FRAME,
    ) -> None:
        """Send a host's frame and deliver it with everything that follows from it."""
        self._frames.append((self.now_ns, can_id, data, flags, owner))
        if not self._delivering:
            self._deliver()

    def step(self, deadline_ns: int | None) -> bool:
        """Move time to the next timer and run all timers of that instant.

        Args:
            deadline_ns: not beyond this time [ns]; None: as far as it takes.

        Returns:
            False when no timer was due until the deadline, which is then the present.

        Raises:
            can.CanOperationError: no deadline and no timer: nothing could ever happen.
        """
        timers = self._timers
        while timers and timers[0][2].action is None:
            heapq.heappop(timers)
        if not timers:
            if deadline_ns is None:
                raise can.CanOperationError(
                    f"lockstep bus {self.name!r}: waiting for ever with no timer pending"
                )
        elif deadline_ns is None or timers[0][0] <= deadline_ns:
            instant = timers[0][0]
            self.now_ns = max(self.now_ns, instant)
            while timers and timers[0][0] <= instant:
                timer = heapq.heappop(timers)[2]
                action, timer.action = timer.action, None
                if action is not None:
                    action()
            return True
        if deadline_ns is not None and deadline_ns > self.now_ns:
            self.now_ns = deadline_ns
        return False

    def sleep_until_ns(self, time_ns: int) -> None:
        """Let virtual time pass until `time_ns`, running every timer on the way."""
        self.check_thread()
        while self.step(time_ns):
            pass

    def _deliver(self) -> None:
        frames = self._frames
        self._delivering = True
        try:
            while frames:
                frame = frames.popleft()
                owner = frame[4]
                for host, queue in self._queues:
                    if host is not owner:
                        queue.append(frame)
                if frame[3] is _DATA_FRAME:
                    for handler in self._handlers.get(frame[1], ()):
                        handler(frame[2])
        finally:
            self._delivering = False


_Frame = tuple[int, int, bytes, tuple[bool, bool, bool], object]  # time, id, data, flags, sender


class LockstepClock:
    """Virtual time of a world, in place of the monotonic clock."""

    __slots__ = ("_world",)

    def __init__(self, world: World) -> None:
        self._world = world

    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._world.now_ns

    def sleep_until_ns(self, time_ns: int) -> None:
        """Let virtual time pass until `time_ns` [ns]."""
        self._world.sleep_until_ns(time_ns)


class LockstepBus(can.BusABC):
    """python-can's view of a `World`: `can.Bus(interface="lockstep", channel=name)`.

    `recv` is overridden as a whole, since `BusABC.recv` measures timeouts on the wall clock.
    Periodic sending runs on virtual timers.

    Attributes:
        world: the segment.
        clock: `now_ns()` and `sleep_until_ns(t)` in virtual time.

    Raises:
        can.CanOperationError: used by a thread other than the world's, or after `shutdown`.
    """

    def __init__(
        self,
        channel: Any = "stage",
        receive_own_messages: bool = False,
        can_filters: can.typechecking.CanFilters | None = None,
        **kwargs: object,
    ) -> None:
        self.world = World.get(channel)
        self.world.check_thread()
        self.clock = LockstepClock(self.world)
        self.channel_info = f"lockstep bus {self.world.name!r}"
        self._queue: deque[_Frame] = deque()
        # The thread that may use the bus: one compare in `send` and `recv` says that it is open,
        # too (0 is no thread's).
        self._thread = get_ident()
        # Own frames are skipped by identity of the sender: None matches nobody.
        self.world.connect(None if receive_own_messages else self, self._queue)
        super().__init__(channel=channel, can_filters=can_filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send; when this returns, all that follows from the frame at this instant is done."""
        world = self.world
        if get_ident() != self._thread:
            self._refuse()
        if msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame:
            flags = (msg.is_extended_id, msg.is_remote_frame, msg.is_error_frame)
            world.transmit(self, msg.arbitration_id, bytes(msg.data), flags)
        else:
            world.transmit(self, msg.arbitration_id, bytes(msg.data))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame; virtual time passes only while there is none.

        Args:
            timeout: virtual time to wait at most [s]; negative counts as 0, None: no limit.
        """
        world = self.world
        if get_ident() != self._thread:
            self._refuse()
        queue = self._queue
        deadline = None if timeout is None else world.now_ns + max(0, round(timeout * 1e9))
        while True:
            while queue:
                time_ns, can_id, data, (extended, remote, error), sender = queue.popleft()
                message = can.Message(
                    time_ns * 1e-9, can_id, extended, remote, error, None, None, data,
                    False, sender is not self,
                )  # fmt: skip
                if self._filters is None or self._matches_filters(message):
                    return message
            if not world.step(deadline) and not queue:
                return None

    def _refuse(self) -> None:
        self.world.check_thread()
        raise can.CanOperationError(f"{self.channel_info}: closed")

    def flush_tx_buffer(self) -> None:
        """Nothing is ever waiting to be sent."""

    def shutdown(self) -> None:
        """Leave the world; harmless when repeated."""
        if self._thread:
            self._thread = 0
            self.world.disconnect(self._queue)
        super().shutdown()

    def _apply_filters(self, filters: can.typechecking.CanFilters | None) -> None:
        pass  # applied in recv

    def _send_periodic_internal(
        self,
        msgs: Sequence[can.Message] | can.Message,
        period: float,
        duration: float | None = None,
        autostart: bool = True,
        modifier_callback: Callable[[can.Message], None] | None = None,
    ) -> CyclicSendTaskABC:
        return LockstepPeriodicTask(self, msgs, period, duration, autostart, modifier_callback)


class LockstepPeriodicTask(
    LimitedDurationCyclicSendTaskABC, ModifiableCyclicTaskABC, RestartableCyclicTaskABC
):
    """`bus.send_periodic` on virtual timers: first frame at once, then every `period` exactly."""

    def __init__(
        self,
        bus: LockstepBus,
        messages: Sequence[can.Message] | can.Message,
        period: float,
        duration: float | None,
        autostart: bool,
        modifier: Callable[[can.Message], None] | None,
    ) -> None:
        if period <= 0:
            raise ValueError(f"period: must be > 0, is {period!r}")
        super().__init__(messages, period, duration)
        self._bus = bus
        self._modifier = modifier
        self._timer: WorldTimer | None = None
        self._running = False
        self._count = 0
        if autostart:
            self.start()

    def start(self) -> None:
        """Send the first frame now; nothing when already running."""
        if self._running:
            return
        now = self._bus.world.now_ns
        self._running = True
        self._end_ns = None if self.duration is None else now + round(self.duration * 1e9)
        self._due_ns = now
        self._fire()

    def stop(self) -> None:
        """Send no more."""
        self._running = False
        if self._timer is not None:
            self._timer.cancel()

    def _fire(self) -> None:
        if self._end_ns is not None and self._due_ns >= self._end_ns:
            self._running = False
        if not self._running:
            return
        message = self.messages[self._count % len(self.messages)]
        self._count += 1
        if self._modifier is not None:
            self._modifier(message)
        self._due_ns += self.period_ns
        self._timer = self._bus.world.at(self._due_ns, self._fire)
        self._bus.send(message)
