"""A stage from the opening of its bus to its closing.

The host's heartbeat is sent while a method runs; the drives stop by themselves after 0.5 s without
it (`idle` waits with heartbeats). One thread at a time uses the bus, but objects can be read and
written from any thread (`axis.node`), during a stream between its SYNCs.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Concatenate, ParamSpec, Self, TypeVar

import can

from drivers.canopen import Network, Tap, open_bus
from drivers.cyclic import Cycle, RealTime, Sink
from drivers.drive import Axis
from drivers.errors import BusError, ConfigurationError, DriverError
from drivers.motion import Power, SafeStop
from drivers.settings import AxisSettings, BusSettings
from drivers.stage.boot import Boot

P = ParamSpec("P")
R = TypeVar("R")
S = TypeVar("S", bound="StageSession")


def exclusive(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """Keeps the bus locked for the whole operation, so that no other thread reads it."""

    @functools.wraps(method)
    def locked(stage: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with stage._network.lock:  # noqa: SLF001  a method's wrapper
            return method(stage, *args, **kwargs)

    return locked


class StageSession:
    """All axes on one bus, opened and closed together; attributes as of `Stage`."""

    def __init__(
        self,
        bus: BusSettings,
        axes: Sequence[AxisSettings],
        bus_object: can.BusABC,
        tap: Tap | None = None,
    ) -> None:
        """Takes an open bus, which the caller closes; applications use `open`."""
        self.sink: Sink | None = None
        self.interrupt: Callable[[], object] | None = None
        self.settings = bus
        self._owned = ExitStack()
        self._open = True
        _check_unique(axes)
        self._network = Network(bus_object, str(bus), tap)
        self._network.watchers.append(self._interrupted)
        self.clock = self._network.clock
        self.axes = tuple(Axis(self._network, axis) for axis in axes)
        self._cycle = Cycle(self._network, self.axes, bus)
        self._power = Power(self._cycle)
        self._real_time = RealTime(bus.realtime)
        self._stopping = SafeStop(self._cycle, self._power)
        self._start = Boot(self._cycle, bus)

    def _interrupted(self, _: int) -> None:
        if self.interrupt is not None:
            self.interrupt()

    @property
    def tap(self) -> Tap | None:
        """Called with every frame sent or received, as in `open`."""
        return self._network.tap

    @tap.setter
    def tap(self, tap: Tap | None) -> None:
        self._network.tap = tap

    def send_frame(self, can_id: int, data: bytes) -> None:
        """Sends a frame that is none of this host's, in the thread that uses the bus.

        Raises:
            BusError: the bus refuses it.
        """
        known = can_id in self._network.own_ids
        self._network.send_message(can_id, data)
        if not known:
            self._network.own_ids.discard(can_id)

    def own_bus(self) -> None:
        """Has this thread alone use the bus; objects that other threads access wait for it."""
        self._network.owner = threading.get_ident()

    @property
    def ending(self) -> bool:
        """Whether a stop or the closing has begun, which must not be interrupted; until `boot`."""
        return self._stopping.begun

    @classmethod
    def open(
        cls,
        bus: BusSettings,
        axes: Sequence[AxisSettings],
        tap: Tap | None = None,
        bus_object: can.BusABC | None = None,
    ) -> Self:
        """Opens the bus and reads the EDS files; nothing is sent yet.

        Args:
            bus: which bus, and its SYNC period.
            axes: settings of the axes.
            tap: called with every frame sent or received: (time [ns], CAN-ID, data).
            bus_object: an open python-can bus to use instead; it stays open at the end. Nothing
                else may read from it meanwhile.

        Raises:
            BusOpenError: the bus cannot be opened.
            ConfigurationError: an EDS is unusable, or settings contradict each other.
        """
        with ExitStack() as owned:
            if bus_object is None:
                bus_object = owned.enter_context(open_bus(bus))
            stage = cls(bus, axes, bus_object, tap)
            stage._owned = owned.pop_all()
        return stage

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and self._open:
            self.safe_stop()
        self.close()

    @exclusive
    def safe_stop(self) -> None:
        """Quick-stops all axes and switches them off, as far as they are reached; never raises."""
        self._stopping.stop()

    @exclusive
    def close(self) -> None:
        """Stops and disables all axes, releases nodes and bus; never raises."""
        if not self._open:
            return
        self._open, self._stopping.begun = False, True
        self._stopping.disable_or_stop()
        for axis in self.axes:
            # a drive that may still be under power keeps watching our heartbeat, and will stop
            if axis.node.booted and axis.name not in self._power.unconfirmed:
                try:
                    axis.node.release()
                except (DriverError, BusError):
                    pass
            axis.node.detach()
        self._cycle.sync.stop()
        self._real_time.end()
        self._network.disconnect()
        self._owned.close()


def _check_unique(axes: Sequence[AxisSettings]) -> None:
    if not axes:
        raise ConfigurationError("a stage needs at least one axis")
    for number, axis in enumerate(axes):
        for other in axes[:number]:
            if axis.node == other.node:
                raise ConfigurationError(
                    f"node {axis.node} already is axis {other.name}", axis=axis.name
                )
            if axis.name == other.name:
                raise ConfigurationError("two axes have this name", axis=axis.name)
