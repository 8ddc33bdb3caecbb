"""python-can interface `lockstep`: a bus in virtual time, delivered in one thread.

When `send` returns, everything that follows from the frame at this instant has happened (`world`).
Only waiting moves time: `recv` with a timeout, and `bus.clock.sleep_until_ns`. `can.Notifier`
cannot be used: its thread would move the time, and is refused.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from threading import get_ident
from typing import Any

import can
from can.broadcastmanager import (
    CyclicSendTaskABC,
    LimitedDurationCyclicSendTaskABC,
    ModifiableCyclicTaskABC,
    RestartableCyclicTaskABC,
)

from hil_sim.bus.subscriptions import PendingAction
from hil_sim.bus.world import DATA_FRAME, Frame, LockstepClock, World

_new = object.__new__


class LockstepBus(can.BusABC):
    """python-can's view of a `World`: `can.Bus(interface="lockstep", channel=name)`.

    `recv` is overridden, because `BusABC.recv` measures timeouts on the wall clock.
    Periodic sending uses virtual timers.

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
        self._queue: deque[Frame] = deque()
        # The thread that may use the bus; 0, which is no thread's, once it is closed.
        self._thread = get_ident()
        # Own frames are skipped by the identity of the sender, which no new object matches.
        self.world.connect(object() if receive_own_messages else self, self._queue)
        super().__init__(channel=channel, can_filters=can_filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; on return, everything that follows from it at this instant has happened.

        `timeout` [s] does nothing: it never waits.
        """
        world = self.world
        if get_ident() != self._thread:
            self._raise_refusal()
        if msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame:
            flags = (msg.is_extended_id, msg.is_remote_frame, msg.is_error_frame)
            world.transmit(self, msg.arbitration_id, bytes(msg.data), flags)
        else:
            world.transmit(self, msg.arbitration_id, bytes(msg.data))

    def exchange(
        self,
        frames: Iterable[tuple[int, bytes]],
        at_ns: int,
        sync_id: int,
        expected: Sequence[tuple[int, int]],
    ) -> Sequence[bytes] | None:
        """Send data frames now and SYNC at `at_ns`, unless a frame comes before it.

        Args:
            frames: id and data of each.
            at_ns: virtual time of SYNC [ns].
            sync_id: id of SYNC, which carries no data.
            expected: id and number of bytes of each data frame that SYNC is to cause, in order.

        Returns:
            The data of the frames expected. An empty sequence where SYNC caused other frames, or
            fewer, or more; all of them wait for `recv`. None where SYNC was not sent, because other
            frames wait for `recv`, the bus has filters, `at_ns` is past, or the world has faults.
            Time never passes `at_ns`.
        """
        world, queue = self.world, self._queue
        if get_ident() != self._thread:
            self._raise_refusal()
        for can_id, data in frames:
            world.transmit(self, can_id, data)
        if queue or self._filters is not None or not world.is_faultless or at_ns < world.now_ns:
            return None
        world.sleep_until_ns(at_ns)
        if queue:
            return None
        world.transmit(self, sync_id, b"")
        if len(queue) != len(expected):
            return ()
        for (_, can_id, data, flags, _), (wanted, size) in zip(queue, expected, strict=True):
            if can_id != wanted or len(data) != size or flags is not DATA_FRAME:
                return ()
        answers = [frame[2] for frame in queue]
        queue.clear()
        return answers

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame; virtual time passes only while there is none.

        Args:
            timeout: longest wait in virtual time [s]; negative counts as 0, None: no limit.
        """
        world = self.world
        if get_ident() != self._thread:
            self._raise_refusal()
        queue = self._queue
        deadline = None if timeout is None else world.now_ns + max(0, round(timeout * 1e9))
        while True:
            while queue:
                message = self._message(queue.popleft())
                if self._filters is None or self._matches_filters(message):
                    return message
            if not world.step(deadline) and not queue:
                return None

    def _message(self, frame: Frame) -> can.Message:
        time_ns, can_id, data, flags, sender = frame
        # field by field: the constructor takes twice as long
        message: can.Message = _new(can.Message)
        message.timestamp = time_ns * 1e-9
        message.arbitration_id = can_id
        message.is_extended_id, message.is_remote_frame, message.is_error_frame = flags
        message.data = bytearray(data)
        message.dlc = len(data)
        message.is_rx = sender is not self
        message.channel = None
        message.is_fd = message.bitrate_switch = message.error_state_indicator = False
        return message

    def _raise_refusal(self) -> None:
        self.world.check_thread()
        raise can.CanOperationError(f"{self.channel_info}: closed")

    def flush_tx_buffer(self) -> None:
        """Do nothing: no frame ever waits to be sent."""

    def shutdown(self) -> None:
        """Disconnect from the world; harmless if repeated."""
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
        self._timer: PendingAction | None = None
        self._running = False
        self._count = 0
        if autostart:
            self.start()

    def start(self) -> None:
        """Send the first frame now, unless the task is running."""
        if self._running:
            return
        now = self._bus.world.now_ns
        self._running = True
        self._end_ns = None if self.duration is None else now + round(self.duration * 1e9)
        self._due_ns = now
        self._fire()

    def stop(self) -> None:
        """Stop sending."""
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
