"""The cyclic path: setpoints out, SYNC, process data in, on an absolute grid; no SDO in here.

One SYNC k at t_k: an RPDO per axis before it, then the SYNC at its instant, then one TPDO per
axis within half a period. What else is on the bus (heartbeats, EMCY) goes to the network's
services; the nodes leave alarms that are looked at once a cycle. When a cycle comes too late,
whole periods are passed over and counted; nothing is sent in a burst.

Mappings are those of `axis.py`: (controlword, target, offset) and (statusword, position, force).
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Callable, Iterator, Sequence

import can
import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.axis import Axis
from drivers.bus import Network, OwnFrame
from drivers.cia402 import ENABLED_MASK, ENABLED_VALUE, decode
from drivers.errors import AxisFault
from drivers.node import Node
from drivers.samples import Sample

SYNC_ID = 0x080

Until = Callable[[tuple[float, ...]], bool]
Sink = Callable[[Sample], object]


class Channel:
    """Cyclic state of one axis: raw integers, as last sent and last received.

    Attributes:
        controlword, target, offset: of the next RPDO (outside streams) or the last one.
        statusword, position, force: of the last TPDO; `seen` is False before the first.
        valid: whether the last cycle brought a TPDO.  arrival: its time after the SYNC [ns].
        missed: TPDOs missed in a row.  told: last controlwords, each once, oldest first.
    """

    __slots__ = (
        "arrival", "axis", "controlword", "force", "missed", "offset", "position", "rpdo",
        "seen", "size", "statusword", "target", "told", "unpack", "valid",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.told: deque[int] = deque(maxlen=4)
        self.adapt()
        self.controlword = self.target = self.offset = 0
        self.statusword = self.position = self.force = 0
        self.seen = self.valid = False
        self.arrival = -1
        self.missed = 0

    def adapt(self) -> None:
        """Takes over the axis' mappings."""
        axis = self.axis
        self.rpdo = OwnFrame(
            arbitration_id=axis.rpdo_id, is_extended_id=False, data=bytes(axis.rpdo.codec.size)
        )
        unpack = axis.tpdo.codec.unpack
        self.size = axis.tpdo.codec.size
        # a drive that tells no force: it reads 0
        self.unpack: Callable[[bytes | bytearray], tuple[int, ...]] = (
            unpack if axis.tells_force else lambda data: (*unpack(data), 0)
        )

    def frame(self) -> bytes:
        """The RPDO of the present command."""
        word = self.controlword
        if not self.told or self.told[-1] != word:
            self.told.append(word)
        if self.axis.takes_force_offset:
            return self.axis.rpdo.codec.pack(word, self.target, self.offset)
        self.offset = 0
        return self.axis.rpdo.codec.pack(word, self.target)


class Cycle:
    """The SYNC producer and what goes with it.

    Attributes:
        channels: one per axis.
        missed, late, skipped, stale: TPDOs missed, SYNCs late, whole periods passed over, TPDOs
            that came outside their window; since the start.
    """

    def __init__(
        self,
        network: Network,
        axes: Sequence[Axis],
        period_ns: int,
        max_missed: int,
        sync_counter: int = 0,
    ) -> None:
        self.channels = tuple(Channel(axis) for axis in axes)
        self.missed = self.late = self.skipped = self.stale = 0
        self._network = network
        self._period = period_ns
        self._window = period_ns // 2
        self._max_missed = max_missed
        self._by_id = {c.axis.tpdo_id: c for c in self.channels}
        self._sync = OwnFrame(arbitration_id=SYNC_ID, is_extended_id=False, data=b"")
        self._overflow, self._count = sync_counter, 0
        self._grid = network.clock.now_ns()
        self._due = self._grid
        self._origin: int | None = None
        self._alarmed: list[Node] = []
        network.own_ids.add(SYNC_ID)
        for axis in axes:
            network.own_ids.add(axis.rpdo_id)
            axis.node.on_alarm = self._alarmed.append

    def resume(self) -> None:
        """Takes up the SYNC grid after a time without SYNCs; that time is not lateness."""
        now = self._network.clock.now_ns()
        if now > self._due:
            self._due += -(-(now - self._due) // self._period) * self._period

    def exchange(self) -> None:
        """One SYNC with the channels' present commands (state changes, homing, pp).

        Raises:
            BusError: the bus fails.
            AxisFault: an alarm, or process data missing too often in a row.
        """
        self._cycle([channel.frame() for channel in self.channels])
        self.check_alarms()

    def exchange_blindly(self) -> None:
        """One SYNC whatever the nodes say: for stopping."""
        self._cycle([channel.frame() for channel in self.channels])

    def forget(self) -> None:
        """Forgets what the axes said: they are about to be set up anew."""
        for channel in self.channels:
            channel.seen = channel.valid = False
            channel.controlword = channel.offset = 0
            channel.told.clear()

    def clear_alarms(self) -> None:
        """Forgets the nodes' alarms and missed frames."""
        self._alarmed.clear()
        for channel in self.channels:
            channel.axis.node.clear_alarms()
            channel.missed = 0

    def check_alarms(self) -> None:
        """Raises the first alarm of any node.

        Raises:
            AxisFault: with what the node said, or that its process data stay away.
        """
        if self._alarmed:
            node = self._alarmed[0]
            alarm = node.alarm
            if alarm is not None:
                raise AxisFault(alarm.cause, axis=node.name, code=alarm.code)
        for channel in self.channels:
            if channel.missed > self._max_missed:
                raise AxisFault(
                    f"no process data (TPDO 0x{channel.axis.tpdo_id:03X}) for {channel.missed} "
                    "SYNCs in a row",
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def stream(
        self,
        targets: NDArray[np.int64],
        offsets: NDArray[np.int64],
        rows: array[int],
        sink: Sink | None,
        until: Until | None,
    ) -> None:
        """One SYNC per row of setpoints, appending one `Sample` each to `rows`.

        Args:
            targets: int64[K, n] [increments].
            offsets: int64[K, n] [1/1000 rated].
            rows: taken over as far as it got, also when this raises.
            sink: called with each `Sample`.
            until: called with the actual positions [m]; True ends the stream.

        Raises:
            BusError: the bus fails.
            AxisFault: an axis leaves OPERATION ENABLED, alarms, or its data stay away.
        """
        channels = self.channels
        for j, channel in enumerate(channels):
            if not channel.axis.takes_force_offset:
                offsets[:, j] = 0
        # made row by row: thousands of rows at once would make the first SYNC late
        frames = [self._frames(c, targets[:, j], offsets[:, j]) for j, c in enumerate(channels)]
        setpoints = [
            zip(targets[:, j].tolist(), offsets[:, j].tolist(), strict=True)
            for j in range(len(channels))
        ]
        increments = [c.axis.scale.increment for c in channels]
        cycle, extend, alarmed = self._cycle, rows.extend, self._alarmed
        max_missed = self._max_missed
        if self._origin is None:
            self.resume()
        for row, commands in zip(
            zip(*frames, strict=True), zip(*setpoints, strict=True), strict=True
        ):
            late = cycle(row)
            if self._origin is None:
                self._origin = self._sent
            values = [self._sent - self._origin, late]
            healthy = not alarmed
            for channel, command in zip(channels, commands, strict=True):
                channel.target, channel.offset = command
                status = channel.statusword
                values += (
                    *command, channel.position, channel.force, status, channel.valid,
                    channel.arrival,
                )  # fmt: skip
                if status & ENABLED_MASK != ENABLED_VALUE or channel.missed > max_missed:
                    healthy = False
            sample = tuple(values)
            extend(sample)
            if sink is not None:
                sink(sample)
            if not healthy:
                self.check_alarms()
                self._check_enabled()
            if until is not None and until(
                tuple([c.position * i for c, i in zip(channels, increments, strict=True)])
            ):
                break

    def _frames(
        self, channel: Channel, targets: NDArray[np.int64], offsets: NDArray[np.int64]
    ) -> Iterator[bytes]:
        """The RPDOs of a stream, packed at once."""
        names = ("controlword", "target", "offset")[: len(channel.axis.rpdo.entries)]
        codes = [e.code for e in channel.axis.rpdo.entries]
        block = np.empty(
            len(targets), dtype=[(n, "<" + c) for n, c in zip(names, codes, strict=True)]
        )
        block["controlword"] = channel.controlword
        block["target"] = targets
        if len(names) > 2:
            block["offset"] = offsets
        data, size = block.tobytes(), block.dtype.itemsize
        return (data[i : i + size] for i in range(0, len(data), size))

    def _check_enabled(self) -> None:
        for channel in self.channels:
            if channel.statusword & ENABLED_MASK != ENABLED_VALUE:
                state = decode(channel.statusword)
                raise AxisFault(
                    f"0x{channel.statusword:04X}: left OPERATION ENABLED, is in {state}",
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def _cycle(self, frames: Sequence[bytes]) -> int:
        """One SYNC; returns 1 when it was late, else 0. `_sent` is its place on the grid."""
        network = self._network
        bus, tap, channels = network.bus, network.tap, self.channels
        now_ns = network.clock.now_ns
        if bus is None:
            raise network.failure("cannot stream", RuntimeError("is closed"))
        try:
            send, recv = bus.send, bus.recv
            now = now_ns()
            for channel, frame in zip(channels, frames, strict=True):
                message = channel.rpdo
                message.data = bytearray(frame)  # not in place: a receiver may keep its own
                if tap is not None:
                    tap(now, message.arbitration_id, frame)
                send(message)
                channel.valid = False
                channel.arrival = -1
            due = self._due
            if now < due:
                network.clock.sleep_until_ns(due)
                now = now_ns()
            # Everything older than this SYNC goes first: a TPDO among it is not this cycle's.
            while (received := recv(0)) is not None:
                self._other(received)
            if now >= network.service_due:
                network.service(now)
            late = 0
            if now - due > self._window:
                late = 1
                self.late += 1
                passed = (now - due) // self._period
                self.skipped += passed
                due += passed * self._period
            self._sent = due
            self._due = due + self._period
            if self._overflow:
                self._count = self._count % self._overflow + 1
                self._sync.data = bytearray((self._count,))
                self._sync.dlc = 1
            if tap is not None:
                tap(now, SYNC_ID, bytes(self._sync.data))
            send(self._sync)
            self._collect(recv, now, now + self._window)
        except (can.CanError, OSError) as why:
            raise network.failure("cyclic exchange failed", why) from why
        return late

    def _collect(
        self, recv: Callable[[float], can.Message | None], sent: int, deadline: int
    ) -> None:
        """Receives until every axis' TPDO is there, or nothing more has come by the deadline."""
        by_id, now_ns, tap = self._by_id, self._network.clock.now_ns, self._network.tap
        left = len(self.channels)
        wait = (deadline - sent) * 1e-9
        while left:
            message = recv(wait)
            now = now_ns()
            if message is not None:
                channel = by_id.get(message.arbitration_id)
                data = message.data
                if channel is None or len(data) != channel.size or message.is_extended_id:
                    self._other(message)
                else:
                    if tap is not None:
                        tap(now, message.arbitration_id, bytes(data))
                    channel.statusword, channel.position, channel.force = channel.unpack(data)
                    channel.arrival = now - sent
                    if not channel.valid:
                        channel.valid = channel.seen = True
                        channel.missed = 0
                        left -= 1
            elif now >= deadline:
                break
            # past the deadline what waits in the queue still counts: it was us who were late
            wait = (deadline - now) * 1e-9 if now < deadline else 0.0
        if left:
            self.missed += left
            for channel in self.channels:
                if not channel.valid:
                    channel.missed += 1

    def _other(self, message: can.Message) -> None:
        self.stale += message.arbitration_id in self._by_id
        self._network.received(message)
