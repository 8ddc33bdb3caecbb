"""The virtual stage in real time on any python-can bus: `stagectl sim`.

One thread waits for a frame or the next timer and lets the drives handle it; they bring the plant
to that time. A real drive samples when SYNC interrupts it, so a frame is handled at its time of
arrival if the bus time-stamps it: a late loop answers late, but never with samples of another
instant. The control ticks are kept in phase with SYNC, as in real drives. A SYNC is not answered if
the next one has already arrived. Frames that the bus refuses are lost, and counted. If the bus can
be reopened, its failure is waited out (`connection`).
"""

from __future__ import annotations

import heapq
import time
from collections import deque
from collections.abc import Callable
from threading import Event

import can

from hil_sim.bus.connection import Connection
from hil_sim.bus.subscriptions import Scheduler
from hil_sim.stage import VirtualStage
from stagedata.stamps import Stamps, is_stamped

_LONGEST_WAIT = 0.05  # [s], so that `stop` is noticed on a silent bus
_SYNC = 0x080
_GAIN, _SLEW = 2e-3, 1_000  # of the phase lock: share of the error, and limit [ns], per SYNC


class RealTimeSegment(Scheduler):
    """A python-can bus as the drives see it.

    Attributes:
        refused: number of frames that the bus did not accept.
        sync_overtaken: the frame being handled is a SYNC, and the next one has arrived already.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Callable[[], int] = time.monotonic_ns,
        tick_ns: int = 0,
        reopen: Callable[[], can.BusABC | None] | None = None,
        notify: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Connect to a bus; `reopen` and `notify` are those of `Connection`.

        Args:
            bus: open.
            clock: monotonic time [ns].
            tick_ns: control period, kept in phase with SYNC [ns]; 0: no phase lock.
            reopen: see above.
            notify: see above.
        """
        super().__init__()
        self.refused = 0
        self._connection = Connection(bus, reopen, notify, clock)
        self._stamps = Stamps() if is_stamped(bus) else None
        self._waiting: deque[tuple[int, int, bytes]] = deque()
        self.sync_overtaken = False
        self._clock = clock
        self._origin = clock()
        self._tick_ns, self._gain = tick_ns, 1.0

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""
        frame = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        if not self._connection.send(frame):
            self.refused += 1

    def close(self) -> None:
        """Close the bus, if it was to be reopened here."""
        self._connection.close()

    def handle_next(self) -> None:
        """Wait a limited time for a frame or timer, and handle what is due."""
        if not self._waiting:
            wait = _LONGEST_WAIT
            if self._timers:
                wait = min(wait, max(0.0, (self._timers[0][0] - self._elapsed()) * 1e-9))
            message = self._connection.recv(wait)
            while message is not None:  # all of them: a SYNC may have been overtaken
                self._enqueue(message)
                message = self._connection.recv(0.0)
        if self._waiting:
            arrival, can_id, data = self._waiting.popleft()
            self._run_timers(arrival)
            self.now_ns = max(self.now_ns, arrival)
            self.sync_overtaken = can_id == _SYNC and any(i == _SYNC for _, i, _ in self._waiting)
            if can_id == _SYNC and self._tick_ns:
                self._track_sync(arrival)
            for handler in self._handlers.get(can_id, ()):
                handler(data)
            self.sync_overtaken = False
        else:
            self._run_timers(self._elapsed())

    def _enqueue(self, message: can.Message) -> None:
        if message.is_extended_id or message.is_remote_frame or message.is_error_frame:
            return
        arrival = self._elapsed()
        if self._stamps is not None:
            arrival = self._stamps(message.timestamp, arrival + self._origin) - self._origin
        self._waiting.append((arrival, message.arbitration_id, bytes(message.data)))

    def _track_sync(self, arrival: int) -> None:
        """Shift time until SYNC is in the middle of a control tick, as a phase-locked loop does.

        There, jitter of SYNC does not skip a tick, in which the demand would stand still.
        """
        error = arrival % self._tick_ns - self._tick_ns // 2
        self._gain = max(_GAIN, self._gain / (1.0 + self._gain))
        self._origin += max(-_SLEW, min(round(self._gain * error), _SLEW))

    def _run_timers(self, until: int) -> None:
        """Run the timers that are due until then, each at its time or now, whichever is later."""
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
    stop: Event,
    reopen: Callable[[], can.BusABC | None] | None = None,
    notify: Callable[[str], object] = lambda _: None,
) -> RealTimeSegment:
    """Run the stage's drives on `bus` until `stop` is set.

    Args:
        stage: not attached to a bus yet.
        bus: any python-can bus; this loop is its only reader.
        stop: ends it.
        reopen: opens the bus again, or returns None while it cannot be opened. With it a failure
            of the bus is waited out, and the bus is closed here at the end.
        notify: called with a line when the bus fails and when it is back.

    Returns:
        The segment, with its count of refused frames.

    Raises:
        can.CanError: the bus has failed, and there is no `reopen`.
    """
    tick_ns = round(stage.settings.control_period * 1e9)
    segment = RealTimeSegment(bus, tick_ns=tick_ns, reopen=reopen, notify=notify)
    try:
        stage.attach(segment)
        while not stop.is_set():
            segment.handle_next()
    finally:
        segment.close()
    return segment
