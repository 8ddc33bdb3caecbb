"""One SYNC on the bus: setpoints before it, process data after it; SYNC is ours or the kernel's.

Keeps the SYNC grid and counts lateness. What lateness means, and what stops the axes, is decided in
`cycle.py`; what comes back is `reception.py`'s. A SYNC takes one of these ways:

- `_follow_kernel`: the kernel sends it, and the first one after our setpoints is theirs
- `_exchange_in_time`: sent here at its instant, on any bus; the next one ends here where it
  cannot go on
- `DirectExchange.try_sync`: one call, on a bus that delivers in its sender's thread
- `_open_window`: an extra one without setpoints, where those would miss the drives' SYNC window
"""

from __future__ import annotations

from collections.abc import Sequence

import can

from drivers.canopen import Network, OwnFrame, delivers_at_once
from drivers.cyclic.channel import Channel
from drivers.cyclic.direct_exchange import DirectBus, DirectExchange
from drivers.cyclic.kernel_sync import KernelSync, receive_own_frames
from drivers.cyclic.reception import Receive, Reception
from drivers.drive import Axis
from drivers.errors import ConfigurationError
from drivers.objects import SYNC_ID
from drivers.settings import BusSettings

_SILENT_PERIODS, _SILENT_NS = 10, 100_000_000
"""The kernel's SYNC counts as lost after the longer of these."""
_MAX_NS = (1 << 31) - 1

_NO_STAMPS = (
    "frames of this bus have no usable time stamp: they count from when they are read, "
    "and samples that jitter are left out of learning"
)

Frames = Sequence[tuple[Channel, bytes]]
"""The RPDOs before a SYNC: one per axis."""


class Exchange:
    """The SYNC producer, with the process data around each SYNC.

    Attributes:
        channels: one per axis.
        reception: what comes back.
        period: Ts [ns].
        sent: place of the last SYNC on the grid [ns].
        offset: time from that place until the SYNC left [ns].
        doubt: by how much later it may have reached the drives [ns]; -1: unknown.
        late: SYNCs that left late, since the start.
        notices: what is not as requested about SYNC and time stamps.
    """

    def __init__(self, network: Network, axes: Sequence[Axis], settings: BusSettings) -> None:
        self.channels = tuple(Channel(axis) for axis in axes)
        self.reception = Reception(network, self.channels, settings)
        self.late = 0
        self.offset, self.doubt = 0, -1
        self.notices: list[str] = []
        self._network = network
        self._settings = settings
        self.period = settings.period_ns
        self._half = settings.period_ns // 2
        self._setpoint_ids = frozenset(c.axis.rpdo_id for c in self.channels)
        self._now_ns = network.clock.now_ns
        self._at_once = delivers_at_once(network.bus)
        self._direct: DirectExchange | None = None
        if isinstance(network.bus, DirectBus):
            self._direct = DirectExchange(network.bus, network, self.reception)
        self._phase: int | None = None
        self._sync = OwnFrame(arbitration_id=SYNC_ID, is_extended_id=False, data=b"")
        self._overflow, self._count = settings.sync_counter, 0
        self._strict = bool(settings.window_us)  # drives drop what comes after the SYNC window
        self._stall = (0, 0)
        self._kernel: KernelSync | None = None
        self._kernel_refused = False
        self._resumed = True
        self.sent = self._due = network.clock.now_ns()
        network.own_ids.add(SYNC_ID)
        network.own_ids |= self._setpoint_ids
        network.other_host.ids |= self._setpoint_ids

    def use_ids(self) -> None:
        """Takes over the CAN-IDs of the axes' process data, which drives may have fixed.

        Raises:
            ConfigurationError: two axes have the same one.
        """
        self.reception.use_ids()
        self._setpoint_ids = frozenset(c.axis.rpdo_id for c in self.channels)
        if len(self._setpoint_ids) < len(self.channels):
            raise ConfigurationError("two axes have the same RPDO CAN-ID", axis=None)
        self._network.own_ids |= self._setpoint_ids
        self._network.other_host.ids |= self._setpoint_ids

    def stalled_periods(self, within_ns: int) -> int:
        """Periods skipped by the last stall, if it ended within `within_ns`; else 0."""
        when, periods = self._stall
        return periods if self.sent - when <= within_ns else 0

    def resume(self) -> None:
        """Continues the SYNC grid after a pause, which does not count as lateness.

        Raises:
            ConfigurationError: the kernel has to send SYNC and cannot.
        """
        self._resumed = True
        if self._kernel is None:
            self._start_kernel_sync()
        if self._kernel is None:
            receive_own_frames(self._network.bus)
        if self.reception.lacks_stamps and _NO_STAMPS not in self.notices:
            self.notices.append(_NO_STAMPS)
        now = self._now_ns()
        if self._kernel is None and now > self._due:
            self._due += -(-(now - self._due) // self.period) * self.period

    def _start_kernel_sync(self) -> None:
        """Has the kernel send SYNC where the settings ask for it and the bus can."""
        source, network = self._settings.sync_source, self._network
        if source == "host" or network.bus is None or self._kernel_refused:
            return
        problem = "is not SocketCAN"
        if KernelSync.fits(network.bus):
            kernel = KernelSync(network.bus, self._settings.period_us, self._overflow)
            try:
                kernel.start()
            except (can.CanError, OSError) as why:
                problem = str(why) or type(why).__name__
            else:
                self._kernel = kernel
                self.reception.follow_kernel(True)
                network.own_ids.discard(SYNC_ID)  # the tap is to see it
                network.other_host.sent_elsewhere.add(SYNC_ID)
                return
        elif source == "auto":
            return
        if source == "kernel":
            raise ConfigurationError(f"sync_source: kernel, but bus {network.label}: {problem}")
        self._kernel_refused = True
        self.notices.append(f"SYNC is sent by the host: no broadcast manager ({problem})")

    def stop(self) -> None:
        """Stops the kernel's SYNC until `resume`; never raises."""
        if self._kernel is not None:
            self._kernel.stop()
            self._kernel, self._phase, self.doubt = None, None, -1
            self.reception.follow_kernel(False)
            self._network.own_ids.add(SYNC_ID)
            self._due = self._now_ns()

    def run(self, frames: Frames) -> int:
        """Exchanges the data of one SYNC; returns 1 where it was late, else 0.

        Raises:
            BusError: the bus fails, or no SYNC comes from the kernel.
        """
        network = self._network
        if network.bus is None:
            raise network.failure("cannot stream", RuntimeError("is closed"))
        try:
            if self._kernel is not None:
                return self._follow_kernel(network.bus, frames)
            return self._lead(network.bus, frames)
        except (can.CanError, OSError, ValueError) as why:  # ValueError: a closed handle
            raise network.failure("cyclic exchange failed", why) from why

    def await_tpdos(self) -> None:
        """Waits for missing TPDOs until the next SYNC is due.

        Raises:
            BusError: the bus fails.
        """
        try:
            self.reception.await_tpdos(self._due)
        except (can.CanError, OSError, ValueError) as why:
            raise self._network.failure("cannot receive", why) from why

    # -- SYNC of our own ------------------------------------------------------------------------

    def _lead(self, bus: can.BusABC, frames: Frames) -> int:
        """One SYNC of our own, at its instant on the grid."""
        late = self._open_window() if self._strict else 0
        now, direct = self._now_ns(), self._direct
        if direct is None or self._overflow or self._due >= self._network.service_due:
            self._send_setpoints(frames, now)
        elif direct.try_sync(frames, self._due, bus.recv):
            self.sent, self._due = self._due, self._due + self.period
            self.offset, self.doubt = 0, -1
            self.late += late
            return late
        late = self._exchange_in_time(bus, now, late)
        self.late += late
        return late

    def _exchange_in_time(self, bus: can.BusABC, now: int, late: int) -> int:
        """Waits from `now` [ns] for the SYNC that is due, sends it and receives; returns `late`."""
        network, now_ns, reception = self._network, self._now_ns, self.reception
        recv, due = bus.recv, self._due
        if now < due:
            if reception.arrival_of is not None and network.service_due < due:
                # while there is time, so that nothing delays the SYNC at its instant
                reception.drain(recv)
                network.service(now_ns())
            network.clock.sleep_until_ns(due)
            now = now_ns()
        reception.drain(recv)
        if now >= network.service_due:
            network.service(now)
        if now - due > self._half:
            late = 1
            passed = (now - due) // self.period
            due += passed * self.period
            self._stall = (due, passed)
        self.sent = due
        self._due = due + self.period
        if reception.arrival_of is not None:
            now = now_ns()
        for channel in self.channels:
            channel.close_cycle()
        self._send_sync(now)
        self.offset = min(now - due, _MAX_NS)
        self.doubt = min(now_ns() - now, _MAX_NS) if self._at_once else -1
        reception.collect(recv, now)
        if reception.echo_at is not None:
            self.offset, self.doubt = min(reception.echo_at - due, _MAX_NS), 0
        return late

    def _send_sync(self, now: int) -> None:
        if self._overflow:
            self._count = self._count % self._overflow + 1
            self._sync.data = bytearray((self._count,))
            self._sync.dlc = 1
        self._network.put(self._sync, bytes(self._sync.data), now)

    def _open_window(self) -> int:
        """Sends an extra SYNC where the last one's window is over: drives would drop setpoints.

        Returns:
            1 where that is lateness, 0 after a pause or where nothing was to be done.
        """
        clock, reception = self._network.clock, self.reception
        resumed, self._resumed = self._resumed, False
        if clock.now_ns() - reception.sync_at <= 1000 * self._settings.window_us:
            return 0
        clock.sleep_until_ns(self._due)
        now = reception.sync_at = clock.now_ns()
        self._due += (max(0, now - self._due) // self.period + 1) * self.period
        self._send_sync(now)
        for channel in self.channels:
            channel.expect_more(1)
        return int(not resumed)

    # -- SYNC of the kernel -----------------------------------------------------------------------

    def _follow_kernel(self, bus: can.BusABC, frames: Frames) -> int:
        """One SYNC of the kernel's: the first on the bus after our setpoints."""
        network, reception, recv = self._network, self.reception, bus.recv
        now = self._now_ns()
        resumed, self._resumed = self._resumed, False
        over = self._strict and now - reception.sync_at > 1000 * self._settings.window_us
        if resumed or over:  # most time is left right after a SYNC; what is queued is old
            reception.drain(recv)
            periods, _ = self._await_sync(recv, frozenset())
            self._due += periods * self.period
            for channel in self.channels:
                channel.expect_more(periods)
            now = self._now_ns()
        self._send_setpoints(frames, now)
        if now >= network.service_due:
            network.service(now)
        periods, at = self._await_sync(recv, self._setpoint_ids)
        passed = periods - 1
        late = int((passed > 0 or over) and not resumed)
        self.late += late
        self.sent = self._due + passed * self.period
        if late:
            self._stall = (self.sent, passed)
        self._due = self.sent + self.period
        if resumed or self._phase is None:
            self._phase = at - self.sent
        self.offset = max(-_MAX_NS, min(at - self.sent - self._phase, _MAX_NS))
        self.doubt = 0  # its own time stamp says when it was on the bus
        reception.collect(recv, at)
        return late

    def _await_sync(self, recv: Receive, own: frozenset[int]) -> tuple[int, int]:
        """Receives up to the first SYNC after our frames `own` were on the bus.

        Returns:
            How many periods have begun meanwhile, and when that SYNC came [ns].

        Raises:
            CanError: none comes.
        """
        now_ns, reception = self._now_ns, self.reception
        left = set(own)
        deadline = now_ns() + max(_SILENT_PERIODS * self.period, _SILENT_NS)
        while True:
            message = recv(max(0.0, (deadline - now_ns()) * 1e-9))
            if message is None:
                if now_ns() >= deadline:
                    what = "our own frames do not" if left else "the kernel's SYNC does not"
                    raise can.CanOperationError(f"{what} appear on the bus: is it up?")
                continue
            can_id = message.arbitration_id
            if can_id in left and not message.is_extended_id:
                left.discard(can_id)
            reception.dispatch(message)
            if can_id == SYNC_ID and not left and not message.is_extended_id:
                return reception.take_kernel_periods()

    # -- both ---------------------------------------------------------------------------------

    def _send_setpoints(self, frames: Frames, now: int) -> None:
        for channel, frame in frames:
            channel.message.data = bytearray(frame)  # a new one: a receiver may keep the old one
            self._network.put(channel.message, frame, now)
