"""Cycles on an absolute SYNC grid: single ones for state changes, streams of setpoints. No SDO.

SYNC k at t_k: one RPDO per axis before it, SYNC at its instant, then one TPDO per axis within its
window (`sync_producer.py`). Heartbeats and EMCY go to the network's services; alarms that nodes
raise are checked once a cycle. A cycle that is late skips whole periods; nothing is sent in a
burst.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.canopen import Network, Node
from drivers.cyclic.channel import Channel
from drivers.cyclic.rows import CorrectedOffsets, Row, planned_rows
from drivers.cyclic.samples import SampleWriter, Sink
from drivers.cyclic.sync_producer import Exchange
from drivers.drive import ENABLED_MASK, ENABLED_VALUE, Axis, decode
from drivers.errors import AxisFault, BusError, ConfigurationError
from drivers.settings import BusSettings
from stagedata import F64

_FOLLOWING_ERROR = 0x8611
_HOST_LOST = (0x8130, 0x8250)
_MAX_DOUBLED = 10
"""Consecutive SYNCs that may bring identical TPDOs twice: networks duplicate frames now and then.
Where they differ there is no sample, and `max_missed` applies."""
_STALL_EFFECT_NS = 200_000_000
"""A fault this soon after a stall of the host may be its consequence."""

Until = Callable[[tuple[float, ...]], bool]
"""Gets the actual positions [m] after each SYNC; True ends the stream."""


class Cycle:
    """Single cycles and streams of cycles, and the checks that end them.

    Attributes:
        sync: the SYNC producer.  axes: in order.  channels: one per axis.
        network, clock: of the bus.  period: Ts [s].
        corrected: rows of streams with corrected force offsets; None where they go as planned.
    """

    def __init__(self, network: Network, axes: Sequence[Axis], settings: BusSettings) -> None:
        self.sync = Exchange(network, axes, settings)
        self.channels = self.sync.channels
        self.axes, self.clock = tuple(axes), network.clock
        self.period = settings.period_ns * 1e-9
        self.network = network
        self._period = settings.period_ns
        self._max_missed, self._max_late = settings.max_missed, settings.max_late
        self.corrected: CorrectedOffsets | None = None
        self._late_in_a_row = 0
        self._origin: int | None = None
        self._alarmed: list[Node | Network] = []
        for axis in axes:
            axis.node.on_alarm = self._alarmed.append
        network.other_host.on_found = lambda: self._alarmed.append(network)

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

    def exchange(self) -> None:
        """One cycle with the channels' present controlwords, targets and offsets.

        Raises:
            BusError: the bus fails.
            AxisFault: an alarm, or process data missing or doubled too often in a row.
        """
        self.exchange_unchecked()
        self.check_alarms()

    def exchange_unchecked(self) -> None:
        """As `exchange`, whatever the nodes report: for stopping."""
        self.sync.run([(channel, channel.pack()) for channel in self.channels])

    def cycles(self, timeout: float, checked: bool = True) -> Iterator[None]:
        """Runs cycles until `timeout` [s] has passed, one per step of a loop over them.

        Each sends the commands that the loop's body has set for the channels. Raises as `exchange`;
        with `checked` False as `exchange_unchecked`.
        """
        self.sync.resume()
        exchange = self.exchange if checked else self.exchange_unchecked
        for _ in range(max(1, round(timeout / self.period))):
            exchange()
            yield

    def clear_alarms(self) -> None:
        """Clears the nodes' alarms and missed samples, but not the presence of another host."""
        self._alarmed.clear()
        if self.network.other_host.found is not None:
            self._alarmed.append(self.network)
        for channel in self.channels:
            channel.axis.node.clear_alarms()
            channel.missed = 0

    def check_alarms(self) -> None:
        """Raises what ends a motion: another host, alarms, missing or doubled process data.

        Raises:
            BusError: another host is on the bus.
            AxisFault: a node's alarm, or too many SYNCs in a row with missing or doubled TPDOs.
        """
        if self._alarmed:
            self.network.check_alone()
            for node in self._alarmed:
                if isinstance(node, Node) and (alarm := node.alarm) is not None:
                    raise AxisFault(
                        alarm.cause + self._preceding_stall(alarm.code), axis=node.name,
                        code=alarm.code,
                    )  # fmt: skip
        for channel in self.channels:
            starved = channel.missed > self._max_missed
            if channel.doubled > _MAX_DOUBLED or (channel.doubled and starved):
                raise self._doubled_tpdos(channel)
            if starved:
                alone = len(self.channels) == 1 or any(c.valid for c in self.channels)
                raise AxisFault(
                    f"no process data (TPDO 0x{channel.axis.tpdo_id:03X}) for {channel.missed} "
                    "SYNCs in a row"
                    + ("" if alone else ", nor from the other axes: bus or supply of all drives?"),
                    axis=channel.axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def _doubled_tpdos(self, channel: Channel) -> AxisFault:
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
        planned: F64 | None = None,
    ) -> None:
        """Runs one cycle per row of setpoints and appends one `Sample` per cycle to `rows`.

        Args:
            targets: int64[K, n] [increments].
            offsets: int64[K, n] [1/1000 rated].
            rows: holds the samples taken so far when this raises.
            sink: called with each `Sample`.
            until: called with the actual positions [m]; True ends the stream.
            planned: float64[K, n], offsets before rounding, which are then corrected on the way
                (`corrected`); None: `offsets` are sent as they are.

        Raises:
            BusError: the bus fails.
            AxisFault: an axis leaves OPERATION ENABLED or raises an alarm, or its data are missing.
        """
        corrected = None if planned is None else self.corrected
        if corrected is not None and planned is not None:
            setpoints = corrected.rows(targets, planned)
        else:
            setpoints = planned_rows(self.channels, targets, offsets)
        try:
            self.stream_rows(setpoints, rows, sink, until)
        finally:
            if corrected is not None:
                corrected.end()

    def stream_rows(
        self, setpoints: Iterator[Row], rows: array[int], sink: Sink | None, until: Until | None
    ) -> None:
        """As `stream`, with rows that are made one by one, each after the sample before it."""
        writer = SampleWriter(self.channels, rows, sink, self.sync.reception.accepts_tardy)
        try:
            self._stream(setpoints, writer, until)
            if writer.waiting:
                self.sync.await_tpdos()
        finally:
            writer.flush()

    def _stream(self, rows: Iterator[Row], writer: SampleWriter, until: Until | None) -> None:
        channels = self.channels
        increments = [c.axis.increment for c in channels]
        sync, alarmed = self.sync, self._alarmed
        max_missed = self._max_missed
        if self._origin is None:
            self.sync.resume()
        self._late_in_a_row = 0
        for frames, setpoints in rows:
            late = sync.run(frames)
            if self._origin is None:
                self._origin = sync.sent
            values = [sync.sent - self._origin, late, sync.offset, sync.doubt]
            healthy, complete = not alarmed, True
            for channel, target, offset in setpoints:
                channel.target = target
                channel.offset = offset
                status, valid = channel.statusword, channel.valid
                values += (
                    target, offset, channel.position, channel.force, status, valid,
                    channel.arrival, channel.previous_extra,
                )  # fmt: skip
                if not valid:
                    complete = False
                if (
                    status & ENABLED_MASK != ENABLED_VALUE
                    or channel.missed > max_missed
                    or channel.doubled > _MAX_DOUBLED
                ):
                    healthy = False
            writer.write(values, complete)
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

    def _preceding_stall(self, code: int | None) -> str:
        """A clause where a stall of the host explains the fault, else an empty text.

        A demand that stands still at speed is a following error, and a host that is silent for half
        a second counts as lost.
        """
        stall = self.sync.stalled_periods(_STALL_EFFECT_NS)
        if not stall or code not in (_FOLLOWING_ERROR, *_HOST_LOST):
            return ""
        if code in _HOST_LOST:
            return f"; the host had just stalled for {stall * self._period * 1e-9:.3g} s"
        return f"; the host had just stalled for {stall} SYNC periods, and the demand with it"

    def _check_late(self) -> None:
        self._late_in_a_row += 1
        if self._late_in_a_row > self._max_late:
            raise BusError(
                f"bus {self.network.label}: SYNC was late {self._late_in_a_row} times in a row "
                f"(max_late is {self._max_late}): the host cannot keep up with "
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
