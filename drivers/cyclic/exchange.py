"""One SYNC on the bus: setpoints before it, process data after it; our own SYNC or the kernel's.

Counts what is punctual and what is not; what it means, and what stops the axes, is `cycle.py`'s.
Where frames carry the time of their arrival, that is what counts, however late they are read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import can

from drivers.canopen import MonotonicClock, Network, OwnFrame, delivers_at_once, stamps_of
from drivers.cyclic.channel import Channel
from drivers.cyclic.sync import KernelSync, hear_own_frames
from drivers.drive import Axis
from drivers.errors import ConfigurationError
from drivers.objects import SYNC_ID
from drivers.settings import BusSettings

_SILENT_PERIODS, _SILENT_NS = 10, 100_000_000
"""The kernel's SYNC is gone when none comes for so long."""
_MOST_NS = (1 << 31) - 1
_EVER_NS = 1 << 62
_WINDOW_SHARE = 0.6
"""Of the drives' SYNC window: when it ends, our own setpoints must be out as well."""


_NO_STAMPS = (
    "frames of this bus carry no time stamp that can be used: they count from when they are read, "
    "and samples that jitter are left out of learning"
)

Frames = Sequence[tuple[Channel, bytes]]
"""The RPDOs before a SYNC: one of each axis."""


class Exchange:
    """The SYNC producer and what goes with it.

    Attributes:
        channels: one per axis.
        sent: place on the grid of the last SYNC [ns].
        offset, doubt: when it left after that place, as well as it is known, and by how much later
            than that it may have reached the drives [ns]; doubt -1: not known.
        missed, late, skipped, stale: samples missed, SYNCs late, whole periods passed over, TPDOs
            that came besides (outside their window, or doubled); since the start.
        notices: what about SYNC and time stamps is not as asked for.
    """

    def __init__(self, network: Network, axes: Sequence[Axis], settings: BusSettings) -> None:
        self.channels = tuple(Channel(axis) for axis in axes)
        self.missed = self.late = self.skipped = self.stale = 0
        self.notices: list[str] = []
        self._network = network
        self._settings = settings
        self._period = settings.period_ns
        self._half = self._window = settings.period_ns // 2
        if settings.window_us:
            self._window = round(_WINDOW_SHARE * 1000 * settings.window_us)
        self._by_id = {c.axis.tpdo_id: c for c in self.channels}
        self._setpoint_ids = frozenset(c.axis.rpdo_id for c in self.channels)
        self._now_ns = network.clock.now_ns
        self._arrived = stamps_of(network.bus)
        self._at_once = delivers_at_once(network.bus)
        self.offset, self.doubt = 0, -1
        self._phase: int | None = None
        self._sync = OwnFrame(arbitration_id=SYNC_ID, is_extended_id=False, data=b"")
        self._overflow, self._count = settings.sync_counter, 0
        self._strict = bool(settings.window_us)  # what comes after the SYNC window does not count
        self._latest = self._window if self._strict else _EVER_NS
        self._sync_at = 0
        self._stall = (0, 0)
        self._kernel: KernelSync | None = None
        self._asked = False
        self._fresh = True
        self._begun = 0
        self._synced = 0
        self.sent = self._due = network.clock.now_ns()
        network.own_ids.add(SYNC_ID)
        network.own_ids |= self._setpoint_ids
        network.other_host.ids |= self._setpoint_ids
        self._note_sent = network.other_host.sent if network.other_host.echoes else None

    def stalled(self, within_ns: int) -> int:
        """Periods passed over in one go, which ended within the last time; 0: none."""
        when, periods = self._stall
        return periods if self.sent - when <= within_ns else 0

    def resume(self) -> None:
        """Takes up the SYNC grid after a time without SYNCs; that time is not lateness."""
        self._fresh = True
        if self._kernel is None:
            self._ask_the_kernel()
        if self._kernel is None:
            hear_own_frames(self._network.bus)
        if self._unstamped and _NO_STAMPS not in self.notices:
            self.notices.append(_NO_STAMPS)
        now = self._network.clock.now_ns()
        if self._kernel is None and now > self._due:
            self._due += -(-(now - self._due) // self._period) * self._period

    def _ask_the_kernel(self) -> None:
        """Lets the kernel send SYNC where it is to, and can.

        Raises:
            ConfigurationError: it has to, and cannot.
        """
        source, network = self._settings.sync_source, self._network
        if source == "host" or network.bus is None or self._asked:
            return
        problem = "is not SocketCAN"
        if KernelSync.fits(network.bus):
            kernel = KernelSync(network.bus, self._settings.period_us, self._overflow)
            try:
                kernel.start()
            except (can.CanError, OSError) as why:
                problem = str(why) or type(why).__name__
            else:
                self._kernel, self._synced, self._begun = kernel, 0, 0
                network.own_ids.discard(SYNC_ID)  # the tap is to see it
                network.other_host.sent_elsewhere.add(SYNC_ID)
                return
        elif source == "auto":
            return
        if source == "kernel":
            raise ConfigurationError(f"sync_source: kernel, but bus {network.label}: {problem}")
        self._asked = True
        self.notices.append(f"SYNC is sent by the host: no broadcast manager ({problem})")

    @property
    def _unstamped(self) -> bool:
        """Whether frames of a bus in real time don't tell when they came."""
        if self._arrived is None:
            return isinstance(self._network.clock, MonotonicClock)
        return self._arrived.useless

    def stop(self) -> None:
        """No SYNC from the kernel until `resume`; never raises."""
        if self._kernel is not None:
            self._kernel.stop()
            self._kernel, self._phase, self.doubt = None, None, -1
            self._network.own_ids.add(SYNC_ID)
            self._due = self._network.clock.now_ns()

    def run(self, frames: Frames) -> int:
        """One SYNC; returns 1 when it was late, else 0. `sent` is its place on the grid."""
        network = self._network
        if network.bus is None:
            raise network.failure("cannot stream", RuntimeError("is closed"))
        try:
            if self._kernel is not None:
                return self._follow(network.bus, frames)
            return self._lead(network.bus, frames)
        except (can.CanError, OSError, ValueError) as why:  # ValueError: a closed handle
            raise network.failure("cyclic exchange failed", why) from why

    def _lead(self, bus: can.BusABC, frames: Frames) -> int:
        """One SYNC of our own, at its instant on the grid."""
        network, now_ns = self._network, self._now_ns
        send, recv = bus.send, bus.recv
        late = self._open_window(send) if self._strict else 0
        now = now_ns()
        self._send_setpoints(send, frames, now)
        due = self._due
        if now < due:
            if self._arrived is not None and network.service_due < due:
                # while there is time: at its instant the SYNC waits for nothing
                while (received := recv(0)) is not None:
                    self._between(received)
                network.service(now_ns())
            network.clock.sleep_until_ns(due)
            now = now_ns()
        # Everything older than this SYNC goes first: a TPDO among it is not this cycle's.
        while (received := recv(0)) is not None:
            self._between(received)
        if now >= network.service_due:
            network.service(now)
        if now - due > self._half:
            late = 1
            passed = (now - due) // self._period
            self.skipped += passed
            due += passed * self._period
            self._stall = (due, passed)
        self.late += late
        self.sent = due
        self._due = due + self._period
        if self._arrived is not None:
            now = now_ns()
        for channel in self.channels:
            channel.turn()
        self._send_sync(send, now)
        off = now - due
        self.offset = off if off < _MOST_NS else _MOST_NS
        self.doubt = min(now_ns() - now, _MOST_NS) if self._at_once else -1
        self._collect(recv, now)
        return late

    def _send_sync(self, send: Callable[[can.Message], None], now: int) -> None:
        if self._overflow:
            self._count = self._count % self._overflow + 1
            self._sync.data = bytearray((self._count,))
            self._sync.dlc = 1
        if self._network.tap is not None:
            self._network.tap(now, SYNC_ID, bytes(self._sync.data))
        if self._note_sent is not None:
            self._note_sent(SYNC_ID, bytes(self._sync.data), now)
        send(self._sync)

    def _open_window(self, send: Callable[[can.Message], None]) -> int:
        """Where the last SYNC's window is over, drives take set-points only after another SYNC.

        Returns:
            1 where that is lateness, 0 where there was a pause or nothing to do.
        """
        clock = self._network.clock
        fresh, self._fresh = self._fresh, False
        if clock.now_ns() - self._sync_at <= 1000 * self._settings.window_us:
            return 0
        clock.sleep_until_ns(self._due)
        self._sync_at = clock.now_ns()
        passed = max(0, self._sync_at - self._due) // self._period + 1
        self._due += passed * self._period
        self._send_sync(send, self._sync_at)
        for channel in self.channels:
            channel.owe(1)
        return int(not fresh)

    def _follow(self, bus: can.BusABC, frames: Frames) -> int:
        """One SYNC of the kernel's: the first that goes over the bus after our setpoints."""
        network, recv = self._network, bus.recv
        now = network.clock.now_ns()
        fresh = self._fresh
        self._fresh = False
        over = self._strict and now - self._sync_at > 1000 * self._settings.window_us
        if fresh or over:  # after a SYNC there is most time; what is in the queue is long ago
            while (received := recv(0)) is not None:
                self._between(received)
            begun, _ = self._await_sync(recv, frozenset())
            self._due += begun * self._period
            for channel in self.channels:
                channel.owe(begun)
            now = network.clock.now_ns()
        self._send_setpoints(bus.send, frames, now)
        if now >= network.service_due:
            network.service(now)
        went, at = self._await_sync(recv, self._setpoint_ids)
        passed = went - 1
        late = int((passed > 0 or over) and not fresh)
        self.late += late
        self.skipped += 0 if fresh else passed
        self.sent = self._due + passed * self._period
        if late:
            self._stall = (self.sent, passed)
        self._due = self.sent + self._period
        if fresh or self._phase is None:
            self._phase = at - self.sent
        self.offset = max(-_MOST_NS, min(at - self.sent - self._phase, _MOST_NS))
        self.doubt = 0  # its own stamp: when it was on the bus
        self._collect(recv, at)
        return late

    def _await_sync(
        self, recv: Callable[[float], can.Message | None], owed: frozenset[int]
    ) -> tuple[int, int]:
        """Receives up to the first SYNC after our frames `owed` went over the bus.

        Returns:
            How many periods have begun meanwhile, and when that SYNC came [ns].

        Raises:
            CanError: none comes.
        """
        clock = self._network.clock
        left = set(owed)
        deadline = clock.now_ns() + max(_SILENT_PERIODS * self._period, _SILENT_NS)
        while True:
            message = recv(max(0.0, (deadline - clock.now_ns()) * 1e-9))
            if message is None:
                if clock.now_ns() >= deadline:
                    what = "our own frames do not" if left else "the kernel's SYNC does not"
                    raise can.CanOperationError(f"{what} come over the bus: is it up?")
                continue
            can_id = message.arbitration_id
            if can_id in left and not message.is_extended_id:
                left.discard(can_id)
            self._between(message)
            if can_id == SYNC_ID and not left and not message.is_extended_id:
                begun, self._begun = self._begun, 0
                return begun, self._synced

    def _send_setpoints(
        self, send: Callable[[can.Message], None], frames: Frames, now: int
    ) -> None:
        tap = self._network.tap
        for channel, frame in frames:
            message = channel.rpdo
            message.data = bytearray(frame)  # not in place: a receiver may keep its own
            if tap is not None:
                tap(now, message.arbitration_id, frame)
            if self._note_sent is not None:
                self._note_sent(message.arbitration_id, frame, now)
            send(message)

    def _collect(self, recv: Callable[[float], can.Message | None], sent: int) -> None:
        """Receives until every axis' TPDO is there, or nothing more has come by the deadline."""
        channels, by_id, tap = self.channels, self._by_id, self._network.tap
        now_ns, arrived, latest = self._now_ns, self._arrived, self._latest
        deadline = sent + self._window
        left = len(channels)
        self._sync_at = sent
        for asked in channels:
            asked.expect()
        if arrived is None:
            now = sent
        else:
            for asked in channels:
                asked.previous, asked.tardy = asked.tardy, None
            now = now_ns()
        while True:
            # past the deadline what waits in the queue still counts: it was us who were late
            message = recv((deadline - now) * 1e-9 if now < deadline else 0.0)
            now = now_ns()
            if message is None:
                if now < deadline:
                    continue
                break
            data = message.data
            channel = by_id.get(message.arbitration_id)
            if channel is None or len(data) != channel.size or message.is_extended_id:
                self._between(message)
                if self._begun:  # the kernel's next SYNC: nothing more comes for this one
                    break
                continue
            if tap is not None:
                tap(now, message.arbitration_id, bytes(data))
            arrival = (now if arrived is None else arrived(message.timestamp, now)) - sent
            if channel.valid or not 0 <= arrival <= latest:
                self._besides(channel, data)
                continue
            channel.take(data, arrival)
            left -= 1
            if not left:
                break
        for asked in channels:
            if not asked.conclude():
                self.missed += 1

    def _between(self, message: can.Message) -> None:
        """A frame that is no TPDO of this cycle: the kernel's SYNC, one too many, or another's."""
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        can_id = message.arbitration_id
        if can_id == SYNC_ID:
            if self._kernel is not None:
                self._note_sync(message)
                return
            self._note_echo(message)
        channel = self._by_id.get(can_id)
        if channel is not None and len(message.data) == channel.size:
            if not self._take_tardy(channel, message):
                self._besides(channel, message.data)
        self._network.received(message)

    def _take_tardy(self, channel: Channel, message: can.Message) -> bool:
        """We went on without it, but it is this SYNC's: the next one has not been yet."""
        arrived = self._arrived
        if arrived is None or self._strict or self._begun or channel.answered or channel.tardy:
            return False
        arrival = arrived(message.timestamp, self._network.clock.now_ns()) - self._sync_at
        if not (channel.missed and 0 <= arrival < self._period):
            return False
        status, position, force = channel.unpack(message.data)
        channel.tardy = (status, position, force, arrival)
        channel.missed = 0
        self.missed -= 1
        return True

    @property
    def stamped(self) -> bool:
        """Whether a TPDO that comes late can still be told to be its SYNC's."""
        return self._arrived is not None and not self._strict

    def settle(self) -> None:
        """Waits for TPDOs that are still owed, at most until the next SYNC is due."""
        until_ns = self._due
        network = self._network
        if network.bus is None or self._arrived is None:
            return
        try:
            while any(not (c.valid or c.tardy) for c in self.channels) and not self._begun:
                left = until_ns - network.clock.now_ns()
                message = network.bus.recv(max(0.0, left * 1e-9))
                if message is not None:
                    self._between(message)
                elif left <= 0:
                    return
        except (can.CanError, OSError, ValueError) as why:
            raise network.failure("cannot receive", why) from why

    def _besides(self, channel: Channel, data: bytearray) -> None:
        self.stale += 1
        channel.besides(data)

    def _note_echo(self, message: can.Message) -> None:
        """Our own SYNC came back, on buses where that happens, stamped as it was for all."""
        if self._arrived is None:
            return
        at = self._arrived(message.timestamp, self._network.clock.now_ns())
        if at >= self._sync_at:
            self.offset, self.doubt = min(at - self.sent, _MOST_NS), 0

    def _note_sync(self, message: can.Message) -> None:
        """The kernel's SYNC: a period has begun, and perhaps more than one."""
        at = self._network.clock.now_ns()
        if self._arrived is not None:
            at = self._arrived(message.timestamp, at)
        first = self._begun == 0
        # the socket's queue may have overflowed, or the kernel's timer have been held up
        since = round((at - self._synced) / self._period) if self._synced else 1
        self._begun += max(1, since)
        self._synced = at
        for channel in self.channels:
            if first:
                channel.turn()
            channel.extra = 0
        if self._network.tap is not None:
            self._network.tap(at, SYNC_ID, bytes(message.data))
