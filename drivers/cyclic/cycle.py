"""The cyclic path: setpoints out, SYNC, process data in, on an absolute grid; no SDO in here.

One SYNC k at t_k: an RPDO per axis before it, then the SYNC at its instant, then one TPDO per
axis within its window (`exchange.py`). What else is on the bus (heartbeats, EMCY) goes to the
network's services; the nodes leave alarms that are looked at once a cycle. When a cycle comes too
late, whole periods are passed over and counted; nothing is sent in a burst.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Iterator, Sequence
from itertools import repeat
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.canopen import Clock, Network, Node
from drivers.cyclic.channel import Channel
from drivers.cyclic.exchange import Exchange
from drivers.cyclic.samples import FIELDS, HEAD, VALID, Sample
from drivers.drive import ENABLED_MASK, ENABLED_VALUE, Axis, decode
from drivers.errors import AxisFault, BusError, ConfigurationError
from drivers.settings import BusSettings

_FOLLOWING_ERROR = 0x8611
_HOST_LOST = (0x8130, 0x8250)
_MOST_DOUBLED = 10
"""SYNCs in a row that may bring the same TPDO more than once: networks double frames now and then.
Where they differ there is no sample, and `max_missed` counts."""
_STALL_COUNTS_NS = 200_000_000
"""A fault within this time after late SYNCs may be their doing."""

Until = Callable[[tuple[float, ...]], bool]
Sink = Callable[[Sample], object]


class Cycle:
    """SYNC after SYNC: single ones for changes of state, streams of setpoints, and their health.

    Attributes:
        sync: the SYNC producer, with what it counts.  channels: one per axis.
    """

    def __init__(self, network: Network, axes: Sequence[Axis], settings: BusSettings) -> None:
        self.sync = Exchange(network, axes, settings)
        self.channels = self.sync.channels
        self._network = network
        self._period = settings.period_ns
        self._max_missed, self._max_late = settings.max_missed, settings.max_late
        self._late_in_a_row = 0
        self._origin: int | None = None
        self._alarmed: list[Node | Network] = []
        for axis in axes:
            axis.node.on_alarm = self._alarmed.append
        network.other_host.on_found = lambda: self._alarmed.append(network)

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Of all channels, in order."""
        return tuple(c.axis for c in self.channels)

    @property
    def period(self) -> float:
        """Ts [s]."""
        return self._period * 1e-9

    @property
    def clock(self) -> Clock:
        """The time that the bus runs in."""
        return self._network.clock

    def pump(self, duration: float) -> None:
        """Waits for `duration` [s] without SYNC, keeping heartbeats up both ways."""
        self._network.pump(duration)

    def channel(self, axis: str) -> Channel:
        """The channel of the axis of this name.

        Raises:
            ConfigurationError: there is none.
        """
        for channel in self.channels:
            if channel.axis.name == axis:
                return channel
        names = ", ".join(a.name for a in self.axes)
        raise ConfigurationError(f"no such axis (there are {names})", axis=axis)

    def resume(self) -> None:
        """Takes up the SYNC grid after a time without SYNCs; that time is not lateness."""
        self.sync.resume()

    def exchange(self) -> None:
        """One SYNC with the channels' present commands (state changes, homing, pp).

        Raises:
            BusError: the bus fails.
            AxisFault: an alarm, or process data missing or doubled too often in a row.
        """
        self.sync.run([(channel, channel.frame()) for channel in self.channels])
        self.check_alarms()

    def exchange_blindly(self) -> None:
        """One SYNC whatever the nodes say: for stopping."""
        self.sync.run([(channel, channel.frame()) for channel in self.channels])

    def forget(self) -> None:
        """Forgets what the axes said: they are about to be set up anew."""
        for channel in self.channels:
            channel.forget()

    def beat(self, on: bool) -> None:
        """Whether the host's heartbeat goes out; off: drives that hear nothing else stop."""
        self._network.beats = on

    def clear_alarms(self) -> None:
        """Forgets the nodes' alarms and missed frames; another host is not forgotten."""
        self._alarmed.clear()
        if self._network.other_host.found is not None:
            self._alarmed.append(self._network)
        for channel in self.channels:
            channel.axis.node.clear_alarms()
            channel.missed = 0

    def check_alarms(self) -> None:
        """Raises the first alarm of any node; before that, that the nodes have another host.

        Raises:
            AxisFault: with what the node said, or that its process data stay away or are doubled.
            BusError: there is another host.
        """
        if self._alarmed:
            self._network.check_alone()
            for node in self._alarmed:
                if isinstance(node, Node) and (alarm := node.alarm) is not None:
                    raise AxisFault(
                        alarm.cause + self._stall_before(alarm.code), axis=node.name,
                        code=alarm.code,
                    )  # fmt: skip
        for channel in self.channels:
            starved = channel.missed > self._max_missed
            if channel.doubled > _MOST_DOUBLED or (channel.doubled and starved):
                raise self._doubled(channel)
            if starved:
                alone = len(self.channels) == 1 or any(c.valid for c in self.channels)
                raise AxisFault(
                    f"no process data (TPDO 0x{channel.axis.tpdo_id:03X}) for {channel.missed} "
                    "SYNCs in a row"
                    + ("" if alone else ", nor from the other axes: bus or supply of all drives?"),
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def _doubled(self, channel: Channel) -> AxisFault:
        axis = channel.axis
        alone = len(self.channels) == 1 or not all(c.doubled for c in self.channels)
        return AxisFault(
            f"more than one TPDO 0x{axis.tpdo_id:03X} for each of {channel.doubled} SYNCs in a row"
            + (
                f": do two devices have node id {axis.node.id}?"
                if alone
                else ", and from the other axes: a second SYNC, or a bus that doubles all frames?"
            ),
            axis=axis.name, obj=od.STATUSWORD,
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
        outlet = _Outlet(self.channels, rows, sink, waits=self.sync.stamped)
        try:
            self._stream(targets, offsets, outlet, until)
            if outlet.waiting:
                self.sync.settle()
        finally:
            outlet.flush()

    def _stream(
        self,
        targets: NDArray[np.int64],
        offsets: NDArray[np.int64],
        outlet: _Outlet,
        until: Until | None,
    ) -> None:
        channels = self.channels
        for j, channel in enumerate(channels):
            if not channel.axis.takes_force_offset:
                offsets[:, j] = 0
        # Made row by row: thousands of rows at once would make the first SYNC late. Each entry
        # brings its channel along: pairing them up at every SYNC takes longer.
        frames = [
            zip(repeat(c), self._frames(c, targets[:, j], offsets[:, j]), strict=False)
            for j, c in enumerate(channels)
        ]
        setpoints = [
            zip(repeat(c), targets[:, j].tolist(), offsets[:, j].tolist(), strict=False)
            for j, c in enumerate(channels)
        ]
        increments = [c.axis.scale.increment for c in channels]
        sync, run, alarmed = self.sync, self.sync.run, self._alarmed
        max_missed = self._max_missed
        if self._origin is None:
            self.resume()
        self._late_in_a_row = 0
        for row, commands in zip(
            zip(*frames, strict=True), zip(*setpoints, strict=True), strict=True
        ):
            late = run(row)
            if self._origin is None:
                self._origin = sync.sent
            values = [sync.sent - self._origin, late, sync.offset, sync.doubt]
            healthy, complete = not alarmed, True
            for channel, target, offset in commands:
                channel.target = target
                channel.offset = offset
                status, valid = channel.statusword, channel.valid
                values += (
                    target, offset, channel.position, channel.force, status, valid,
                    channel.arrival, channel.before,
                )  # fmt: skip
                if not valid:
                    complete = False
                if (
                    status & ENABLED_MASK != ENABLED_VALUE
                    or channel.missed > max_missed
                    or channel.doubled > _MOST_DOUBLED
                ):
                    healthy = False
            outlet.take(values, complete)
            if not healthy:
                self.check_alarms()
                self._check_enabled()
            if late:
                self._check_late()
            elif self._late_in_a_row:
                self._late_in_a_row = 0
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
        return map(itemgetter(0), struct.iter_unpack(f"{size}s", data))

    def _stall_before(self, code: int | None) -> str:
        """A demand that stands still for some periods at speed is a following error by itself.

        And a host that stands still for half a second is a lost host.
        """
        stall = self.sync.stalled(_STALL_COUNTS_NS)
        if not stall or code not in (_FOLLOWING_ERROR, *_HOST_LOST):
            return ""
        if code in _HOST_LOST:
            return f"; the host had just stood still for {stall * self._period * 1e-9:.3g} s"
        return f"; the host had just been {stall} SYNC periods late: the demand stood still so long"

    def _check_late(self) -> None:
        self._late_in_a_row += 1
        if self._late_in_a_row > self._max_late:
            raise BusError(
                f"bus {self._network.label}: SYNC was late {self._late_in_a_row} times in a row "
                f"(max_late is {self._max_late}): the host does not keep up with "
                f"{self._period * 1e-6:g} ms"
            )

    def _check_enabled(self) -> None:
        for channel in self.channels:
            if channel.statusword & ENABLED_MASK != ENABLED_VALUE:
                state = decode(channel.statusword)
                raise AxisFault(
                    f"0x{channel.statusword:04X}: left OPERATION ENABLED, is in {state}",
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip


class _Outlet:
    """Hands samples on, in order. One that still lacks a TPDO waits until the next SYNC is over."""

    def __init__(
        self, channels: Sequence[Channel], rows: array[int], sink: Sink | None, waits: bool
    ) -> None:
        self._channels = channels
        # packed first: an array takes single numbers seven times as slowly
        self._pack = struct.Struct(f"{HEAD + FIELDS * len(channels)}q").pack
        self._extend, self._sink, self._waits = rows.frombytes, sink, waits
        self.waiting: list[int] | None = None

    def take(self, values: list[int], complete: bool) -> None:
        """The sample of one more SYNC."""
        if self.waiting is not None:
            self._hand_on(self._completed(self.waiting, [c.previous for c in self._channels]))
            self.waiting = None
        if complete or not self._waits:  # as `_hand_on`, for every SYNC
            self._extend(self._pack(*values))
            if self._sink is not None:
                self._sink(tuple(values))
        else:
            self.waiting = values

    def flush(self) -> None:
        """Nothing follows."""
        values, self.waiting = self.waiting, None
        if values is not None:
            self._hand_on(self._completed(values, [c.tardy for c in self._channels]))

    def _hand_on(self, values: list[int]) -> None:
        self._extend(self._pack(*values))
        if self._sink is not None:
            self._sink(tuple(values))

    def _completed(
        self, values: list[int], tardy: Sequence[tuple[int, int, int, int] | None]
    ) -> list[int]:
        """With what came after we had gone on without it."""
        for axis, late in enumerate(tardy):
            at = HEAD + axis * FIELDS
            if late is not None and not values[at + VALID]:
                status, position, force, arrival = late
                values[at + 2 : at + 7] = (position, force, status, True, arrival)
        return values
