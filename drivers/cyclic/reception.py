"""What the bus delivers in the cyclic path: TPDOs for the channels, SYNCs, frames for the network.

Where frames carry the time of their arrival, that time counts, however late they are read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import can

from drivers.canopen import MonotonicClock, Network, stamps_of
from drivers.cyclic.channel import Channel
from drivers.errors import ConfigurationError
from drivers.objects import SYNC_ID
from drivers.settings import BusSettings

_FOREVER_NS = 1 << 62
_WINDOW_SHARE = 0.6
"""Part of the drives' SYNC window in which TPDOs are awaited: our setpoints have to be out before
it ends."""

Receive = Callable[[float], can.Message | None]
"""python-can's `recv`: waits so long [s]."""

_COUNTED, _CROWDED = 100, 0.8
"""So many SYNCs in less than this share of as many periods: a second device sends SYNC. One that is
held up does not make them more."""


class Reception:
    """Receives process data, one SYNC at a time.

    Attributes:
        channels: one per axis.
        missed: samples missed since the start.
        sync_at: when the last SYNC was sent, or the kernel's was on the bus [ns].
        echo_at: when our own SYNC came back, on buses that echo frames with time stamps [ns].
        kernel_sends_sync: whether SYNCs received are the kernel's.
        kernel_periods: periods that the kernel's SYNCs have begun since `take_kernel_periods`.
    """

    def __init__(
        self, network: Network, channels: Sequence[Channel], settings: BusSettings
    ) -> None:
        self.channels = channels
        self.missed = 0
        self.sync_at = 0
        self.echo_at: int | None = None
        self.kernel_sends_sync = False
        self.kernel_periods = 0
        self._kernel_sync_at = self._counted = self._counting_since = 0
        self._network = network
        self._period = settings.period_ns
        self._strict = bool(settings.window_us)  # nothing after the SYNC window counts
        self._window = settings.period_ns // 2
        if self._strict:
            self._window = round(_WINDOW_SHARE * 1000 * settings.window_us)
        self._latest = self._window if self._strict else _FOREVER_NS
        self._by_id = {c.axis.tpdo_id: c for c in channels}
        self._force_by_id: dict[int, Channel] = {}
        self._now_ns = network.clock.now_ns
        self.arrival_of = stamps_of(network.bus)

    def use_ids(self) -> None:
        """Takes over the CAN-IDs of the axes' TPDOs.

        Raises:
            ConfigurationError: two axes have the same one.
        """
        self._by_id = {c.axis.tpdo_id: c for c in self.channels}
        alone = [c for c in self.channels if c.force_tpdo is not None]
        self._force_by_id = {c.axis.force_id: c for c in alone}
        ids = self._by_id | self._force_by_id
        if len(ids) < len(self.channels) + len(alone):
            raise ConfigurationError("two axes have the same TPDO CAN-ID", axis=None)

    @property
    def lacks_stamps(self) -> bool:
        """Whether frames of a bus in real time have no usable time of arrival."""
        if self.arrival_of is None:
            return isinstance(self._network.clock, MonotonicClock)
        return self.arrival_of.useless

    @property
    def accepts_tardy(self) -> bool:
        """Whether a TPDO read after the wait can still be assigned to its SYNC."""
        return self.arrival_of is not None and not self._strict

    def follow_kernel(self, follow: bool) -> None:
        """Whether the kernel sends SYNC from now on."""
        self.kernel_sends_sync = follow
        self._kernel_sync_at = self.kernel_periods = self._counted = 0

    def take_kernel_periods(self) -> tuple[int, int]:
        """How many periods have begun since the last call, and the time of the last SYNC [ns]."""
        periods, self.kernel_periods = self.kernel_periods, 0
        return periods, self._kernel_sync_at

    def drain(self, recv: Receive) -> None:
        """Reads what is in the queue; a TPDO among it is of an earlier SYNC."""
        while (message := recv(0)) is not None:
            self.dispatch(message)

    def collect(self, recv: Receive, sync_at: int) -> None:
        """Receives until all TPDOs are there, or the window is over and the queue empty.

        Args:
            recv: of the bus.
            sync_at: time of the SYNC [ns].
        """
        channels, by_id, tap = self.channels, self._by_id, self._network.tap
        now_ns, arrival_of, latest = self._now_ns, self.arrival_of, self._latest
        deadline = sync_at + self._window
        left = len(channels) + len(self._force_by_id)
        self.sync_at, self.echo_at = sync_at, None
        for due in channels:
            due.open_cycle()
        if arrival_of is None:
            now = sync_at
        else:
            for due in channels:
                due.previous_tardy, due.tardy = due.tardy, None
            now = now_ns()
        while True:
            # frames queued at the deadline still count: the host was late, not the drive
            message = recv((deadline - now) * 1e-9 if now < deadline else 0.0)
            now = now_ns()
            if message is None:
                if now < deadline:
                    continue
                break
            data = message.data
            channel = by_id.get(message.arbitration_id)
            if channel is None or len(data) != channel.size or message.is_extended_id:
                if self._take_force(message, now):
                    left -= 1
                    if not left:
                        break
                    continue
                self.dispatch(message)
                if self.kernel_periods:  # the kernel's next SYNC: nothing more comes for this one
                    break
                continue
            if tap is not None:
                tap(now, message.arbitration_id, bytes(data))
            at = now if arrival_of is None else arrival_of(message.timestamp, now)
            arrival = at - sync_at
            if channel.valid or not 0 <= arrival <= latest:
                channel.take_extra(data)
                continue
            channel.take(data, arrival)
            left -= 1
            if not left:
                break
        for due in channels:
            if not due.conclude():
                self.missed += 1

    def _take_force(self, message: can.Message, now: int) -> bool:
        """Takes a TPDO that has an axis' force alone, if this is one of the present SYNC."""
        channel = self._force_by_id.get(message.arbitration_id)
        if channel is None or channel.force_tpdo is None or message.is_extended_id:
            return False
        at = now if self.arrival_of is None else self.arrival_of(message.timestamp, now)
        if len(message.data) != channel.force_tpdo[1]:
            return False
        if not 0 <= at - self.sync_at <= self._latest or not channel.take_force(message.data):
            return False
        if self._network.tap is not None:
            self._network.tap(now, message.arbitration_id, bytes(message.data))
        return True

    def take(self, answers: Sequence[bytes], sync_at: int) -> None:
        """Does what `collect` does, with one TPDO per channel as all that the SYNC has brought.

        The tap has seen them.

        Args:
            answers: data of the TPDOs, which came at once.
            sync_at: time of the SYNC [ns].
        """
        self.sync_at, self.echo_at = sync_at, None
        for channel, data in zip(self.channels, answers, strict=True):
            if not channel.take_sole(data):
                self.missed += 1

    def await_tpdos(self, until_ns: int) -> None:
        """Waits for missing TPDOs, at most until `until_ns` or the next SYNC.

        Raises:
            CanError, OSError, ValueError: the bus fails.
        """
        network = self._network
        if network.bus is None or self.arrival_of is None:
            return
        while any(not (c.valid or c.tardy) for c in self.channels) and not self.kernel_periods:
            left = until_ns - self._now_ns()
            message = network.bus.recv(max(0.0, left * 1e-9))
            if message is not None:
                self.dispatch(message)
            elif left <= 0:
                return

    def dispatch(self, message: can.Message) -> None:
        """Takes a frame that is not an awaited TPDO: a SYNC, a TPDO too many, a service's frame."""
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        can_id = message.arbitration_id
        if can_id == SYNC_ID:
            if self.kernel_sends_sync:
                self._take_kernel_sync(message)
                return
            self._take_echo(message)
        channel = self._by_id.get(can_id)
        if channel is not None and len(message.data) == channel.size:
            if not self._take_tardy(channel, message):
                channel.take_extra(message.data)
        self._network.received(message)

    def _take_tardy(self, channel: Channel, message: can.Message) -> bool:
        """Takes a TPDO of the last SYNC, read after the wait but before the next SYNC."""
        arrival_of = self.arrival_of
        if arrival_of is None or self._strict or self.kernel_periods:
            return False
        if channel.is_answered or channel.tardy or channel.force_tpdo is not None:
            return False
        arrival = arrival_of(message.timestamp, self._now_ns()) - self.sync_at
        if not (channel.missed and 0 <= arrival < self._period):
            return False
        status, position, force = channel.unpack(message.data)
        channel.tardy = (status, position, force, arrival)
        channel.missed = 0
        self.missed -= 1
        return True

    def _take_echo(self, message: can.Message) -> None:
        """Our own SYNC comes back, with the time at which the drives received it."""
        if self.arrival_of is None:
            return
        at = self.arrival_of(message.timestamp, self._now_ns())
        if at >= self.sync_at:
            self.echo_at = at

    def _take_kernel_sync(self, message: can.Message) -> None:
        """The kernel's SYNC: one period has begun, or more where the queue has lost SYNCs."""
        at = self._now_ns()
        if self.arrival_of is not None:
            at = self.arrival_of(message.timestamp, at)
        first = self.kernel_periods == 0
        # the socket's queue may have overflowed, or the kernel's timer have been held up
        since = round((at - self._kernel_sync_at) / self._period) if self._kernel_sync_at else 1
        self.kernel_periods += max(1, since)
        self._kernel_sync_at = at
        if not self._counted:
            self._counting_since = at
        self._counted += 1
        if self._counted > _COUNTED:
            if at - self._counting_since < _CROWDED * _COUNTED * self._period:
                self._network.other_host.reveal("a SYNC (0x080) beside the kernel's")
            self._counted = 0
        for channel in self.channels:
            if first:
                channel.close_cycle()
            channel.extra = 0
        if self._network.tap is not None:
            self._network.tap(at, SYNC_ID, bytes(message.data))
