"""The stage as the application sees it: axes booted, homed, enabled, streamed and stopped together.

A fault of one axis stops all of them. Setpoints are csp (0x607A and 0x60B2, one pair a SYNC); pp
and hm serve jogging and homing. The host's heartbeat goes out while something here runs, and the
drives stop by themselves when the host stays silent for 0.5 s (`idle` waits without that). One
thread at a time has the bus; objects can be read and written from any thread meanwhile
(`axis.node`), during a stream between its SYNCs.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Concatenate, ParamSpec, TypeVar

import can
import numpy as np
from numpy.typing import NDArray

from drivers.canopen import LISTENING, Clock, MonotonicClock, Network, Tap, open_bus
from drivers.cyclic import Cycle, RealTime, Sink, Until
from drivers.drive import Axis
from drivers.errors import BusError, ConfigurationError, DriverError, NodeError
from drivers.motion import (
    HOLDING_TIMEOUT,
    CyclicForce,
    CyclicPosition,
    CyclicVelocity,
    Homing,
    Power,
    ProfileMoves,
    ProfilePosition,
    SafeStop,
)
from drivers.settings import AxisSettings, BusSettings
from stagedata import Samples

_TRIES = 3
"""Of the set-up, where something speaks for two devices with one node id."""

P = ParamSpec("P")
R = TypeVar("R")


def _exclusive(
    method: Callable[Concatenate[Stage, P], R],
) -> Callable[Concatenate[Stage, P], R]:
    """Holds the bus for all of an operation, so that no other thread reads it in between."""

    @functools.wraps(method)
    def held(stage: Stage, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with stage._network.lock:  # noqa: SLF001  a method's wrapper
            return method(stage, *args, **kwargs)

    return held


class Stage:
    """All axes on one bus; a context manager that stops, disables and closes on the way out.

    Attributes:
        axes: one `Axis` per settings, in that order; arrays have their columns in it.
        sink: called with a `Sample` once per streamed SYNC, before anything else is done with it.
    """

    def __init__(
        self,
        bus: BusSettings,
        axes: Sequence[AxisSettings],
        bus_object: can.BusABC,
        tap: Tap | None = None,
    ) -> None:
        """Use `open`; this one takes a bus that its caller closes."""
        self.sink: Sink | None = None
        self.settings = bus
        self._owned: can.BusABC | None = None
        self._open, self._listened = True, False
        _check_unique(axes)
        self._network = Network(bus_object, str(bus), tap)
        self.axes = tuple(Axis(self._network, axis) for axis in axes)
        self._cycle = cycle = Cycle(self._network, self.axes, bus)
        self._power = power = Power(cycle, bus.sync_period)
        self._real_time = real_time = RealTime(bus.realtime)
        self._stopping = stopping = SafeStop(cycle, power)
        self._homing = Homing(cycle, power, stopping)
        self._csp = CyclicPosition(cycle, power, stopping, real_time)
        self._csv = CyclicVelocity(cycle, power, stopping, real_time)
        self._cst = CyclicForce(cycle, power, stopping, real_time)
        self._pp = ProfilePosition(cycle, power, stopping, self._csp.enter)

    @property
    def ending(self) -> bool:
        """A stop or the closing has begun, and nothing may break it off; until the next boot."""
        return self._stopping.begun

    @classmethod
    def open(
        cls,
        bus: BusSettings,
        axes: Sequence[AxisSettings],
        tap: Tap | None = None,
        bus_object: can.BusABC | None = None,
    ) -> Stage:
        """Opens the bus and reads the EDS files; nothing is sent yet.

        Args:
            bus: which bus, and its SYNC period.
            axes: settings of the axes.
            tap: sees every frame sent or received as (time [ns], CAN-ID, data).
            bus_object: an open python-can bus to use instead of opening one; stays open at the
                end. Nobody else may read it meanwhile.

        Raises:
            BusError: the bus cannot be opened.
            ConfigurationError: no usable EDS, or settings that contradict each other.
        """
        used = open_bus(bus) if bus_object is None else bus_object
        try:
            stage = cls(bus, axes, used, tap)
        except BaseException:
            if bus_object is None:
                used.shutdown()
            raise
        if bus_object is None:
            stage._owned = used
        return stage

    def __enter__(self) -> Stage:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None and self._open:
            self.safe_stop()
        self.close()

    # -- what can be asked at any time; nothing is sent for it --------------------------------

    @property
    def enabled(self) -> bool:
        """Whether all axes were in OPERATION ENABLED when last heard."""
        return self._power.enabled

    @property
    def homed(self) -> bool:
        """Whether all axes were homed since their last boot-up."""
        return all(axis.homed for axis in self.axes)

    @property
    def clock(self) -> Clock:
        """The time that everything here runs in: virtual on the lock-step bus."""
        return self._network.clock

    @property
    def positions(self) -> tuple[float, ...]:
        """Actual positions when last heard [m]."""
        return tuple(c.position * c.axis.scale.increment for c in self._cycle.channels)

    @property
    def forces(self) -> tuple[float, ...]:
        """Actual forces when last heard [N]."""
        return tuple(c.force * c.axis.scale.force for c in self._cycle.channels)

    @property
    def targets(self) -> tuple[float, ...]:
        """Target positions sent last [m]: where the next stream has to start."""
        return tuple(c.target * c.axis.scale.increment for c in self._cycle.channels)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Force offsets sent last [N]."""
        return tuple(c.offset * c.axis.scale.force for c in self._cycle.channels)

    @property
    def limitations(self) -> tuple[str, ...]:
        """What the drives do without and what follows, known after `boot`; empty: nothing."""
        return tuple(f"axis {a.name}: {clause}" for a in self.axes for clause in a.limitations)

    @property
    def notices(self) -> tuple[str, ...]:
        """What of SYNC and real time is not as asked for, one clause each; known when moving."""
        return (*self._real_time.refused, *self._cycle.sync.notices)

    @property
    def missed(self) -> int:
        """Process data frames that stayed away, since opening."""
        return self._cycle.sync.missed

    @property
    def late(self) -> int:
        """SYNCs that left more than half a period late, since opening."""
        return self._cycle.sync.late

    # -- life cycle -------------------------------------------------------------------------

    @_exclusive
    def boot(self) -> None:
        """Resets, identifies and configures all nodes and makes them OPERATIONAL.

        Raises:
            NodeError: a node is missing, refuses an access, is another device, or two of them.
            ConfigurationError: a drive cannot be set up as needed.
            BusError: the bus fails, or there is another host on it.
        """
        self._stopping.begun = False
        self._network.other_host.forget()
        self._network.beats = True
        self._listen_first()
        self._cycle.sync.stop()
        self._cycle.forget()
        self._power.mode = None
        if isinstance(self.clock, MonotonicClock):
            self._real_time.begin()
        try:
            self._set_up()
        except (NodeError, ConfigurationError):
            self._network.check_alone()  # then this is what it comes from
            raise
        self._network.check_alone()
        self._cycle.clear_alarms()

    def _set_up(self) -> None:
        for _ in range(_TRIES):
            self._configure()
            twins = [twin for axis in self.axes if (twin := axis.node.twin()) is not None]
            if not twins:
                break
        else:
            raise twins[0]
        for axis in self.axes:
            axis.node.start()

    def _configure(self) -> None:
        for axis in self.axes:
            axis.node.boot()
        for axis in self.axes:
            axis.configure(self.settings)
        for channel in self._cycle.channels:
            channel.adapt()
        self._network.service(self._network.clock.now_ns())

    def _listen_first(self) -> None:
        """In real time: for another host, before the first frame of ours."""
        if self._listened or not isinstance(self.clock, MonotonicClock):
            return
        self._listened = True
        try:
            self._network.listen(LISTENING)
        except BusError:
            for axis in self.axes:
                axis.node.booted = 0  # not at our wish: there is nothing to let go of
            raise

    @_exclusive
    def home(self, force: bool = False) -> None:
        """Homes all axes that are not homed yet (all with `force`).

        They end at rest under power, in mode hm: `enable` is the next step.

        Raises:
            HomingError: names the axis, its method and what the drive says.
            AxisFault: any other fault on the way.
        """
        self._homing.home(force)

    @_exclusive
    def enable(self) -> None:
        """Closes the loops of all axes in csp where they stand; harmless when enabled already.

        Raises:
            AxisFault: an axis is in fault, or does not get there.
        """
        self._csp.enter()

    @_exclusive
    def disable(self) -> None:
        """Takes the force offsets back, then opens the loops of all axes.

        Raises:
            AxisFault: an axis faults meanwhile, or does not tell that it is without power.
        """
        self._stopping.disable()

    @_exclusive
    def quick_stop(self) -> None:
        """Stops all axes at their quick-stop deceleration; they end without power.

        Raises:
            AxisFault: an axis does not stop in time.
            BusError: the bus fails.
        """
        self._stopping.quick_stop()

    @_exclusive
    def halt(self) -> None:
        """Stops all axes by controlword bit 8 (0x605D); they end holding where they stand.

        Raises:
            AxisFault: the stage is not enabled, or an axis does not come to rest; all are stopped.
        """
        self._power.require_enabled()
        with self._stopping.on_failure():
            self._power.halt(10 * self._stopping.braking_time + HOLDING_TIMEOUT)

    @_exclusive
    def reset_faults(self) -> None:
        """Makes all nodes OPERATIONAL again and acknowledges all faults; `enable` is next.

        Raises:
            AxisFault: a fault stays.
            NodeError: a node does not become OPERATIONAL.
        """
        self._network.other_host.forget()
        self._network.beats = True
        for axis in self.axes:
            axis.node.start()  # a drive that missed the host's heartbeat has left it
        with self._stopping.on_failure():
            self._power.reset_faults()

    @_exclusive
    def idle(self, duration: float) -> None:
        """Waits for `duration` [s], keeping heartbeats up both ways.

        Raises:
            AxisFault: an axis says something meanwhile.
        """
        with self._stopping.on_failure():
            self._network.pump(duration)
            self._cycle.check_alarms()

    @_exclusive
    def safe_stop(self) -> None:
        """Quick stop and power off wherever it still reaches; never raises."""
        self._stopping.stop()

    @_exclusive
    def close(self) -> None:
        """Stops and disables what is still moving, lets go of nodes and bus; never raises."""
        if not self._open:
            return
        self._open, self._stopping.begun = False, True
        self._stopping.let_go()
        for axis in self.axes:
            # A drive that may still be under power keeps its watch over our heartbeat: it will
            # stop when that is missing.
            # One that never booted has nothing to be released from.
            if axis.node.booted and axis.name not in self._power.loose:
                try:
                    axis.node.release()
                except (DriverError, BusError):
                    pass
            axis.node.detach()
        self._cycle.sync.stop()
        self._real_time.end()
        self._network.disconnect()
        if self._owned is not None:
            self._owned.shutdown()

    # -- motion -----------------------------------------------------------------------------

    @_exclusive
    def stream(
        self,
        position: NDArray[np.float64],
        offset: NDArray[np.float64],
        until: Until | None = None,
    ) -> Samples:
        """Streams setpoints in csp, one row per SYNC, and returns what the drives sent back.

        Streams that follow each other continue the same SYNC grid. Sample k was taken at SYNC k,
        which also took over row k.

        Args:
            position: float64[K, n] target positions [m].
            offset: float64[K, n] force offsets [N].
            until: gets the actual positions [m] after each SYNC; True ends the stream with it.

        Raises:
            LimitError: a setpoint outside the limits; nothing was sent.
            AxisFault: an axis faulted, or fell silent; all axes are stopped.
            BusError: the bus failed; the drives stop when they miss the host's heartbeat.
        """
        return self._csp.stream(position, offset, until, self.sink)

    @_exclusive
    def stream_velocity(
        self,
        velocity: NDArray[np.float64],
        offset: NDArray[np.float64] | None = None,
        until: Until | None = None,
    ) -> Samples:
        """Streams velocities in csv, from rest to rest; the axes stay enabled in that mode.

        `enable` takes them back to csp. Nothing of it goes to the sink.

        Args:
            velocity: float64[K, n] [m/s]; the last row is 0.
            offset: float64[K, n] force offsets [N], 0 by default.
            until: as for `stream`; what it ends brakes at the acceleration limit.

        Raises:
            LimitError: outside velocity, acceleration or travel; nothing was sent.
            ConfigurationError: a drive without csv.
            AxisFault, BusError: as `stream`.
        """
        return self._csv.stream(velocity, offset, until)

    @_exclusive
    def stream_force(self, force: NDArray[np.float64], until: Until | None = None) -> Samples:
        """Streams forces in cst; the axes stay enabled in that mode, without force.

        `enable` waits for rest and takes them back to csp. Nothing of it goes to the sink.

        Args:
            force: float64[K, n] [N]; the last row is 0.
            until: as for `stream`; what it ends lets go of the axes.

        Raises:
            LimitError: above the peak force; nothing was sent.
            ConfigurationError: a drive without cst.
            AxisFault: besides, an axis got too fast, or near the end of its travel.
            BusError: as `stream`.
        """
        return self._cst.stream(force, until)

    def hold(self, duration: float) -> Samples:
        """Streams the present targets and offsets for `duration` [s]; raises as `stream`."""
        rows = max(1, round(duration / self.settings.sync_period))
        return self.stream(np.tile(self.targets, (rows, 1)), np.tile(self.offsets, (rows, 1)))

    @_exclusive
    def move_to(
        self,
        axis: str,
        position: float | Sequence[float],
        velocity: float,
        acceleration: float,
        relative: bool = False,
    ) -> None:
        """Moves one axis by the drive's own profile (pp); returns when the target is reached.

        The axis ends enabled in csp with all others, holding the target.

        Args:
            axis: its name.
            position: absolute [m], or several: each waits in the drive until the one before is
                reached.
            velocity: of the profile [m/s].
            acceleration: of the profile, both ways [m/s^2].
            relative: positions count from the target before, the first from where the axis is.

        Raises:
            LimitError: outside the axis' limits; nothing was sent.
            AxisFault: the axis faulted or did not arrive; all axes are stopped.
        """
        self._pp.move_to(axis, position, velocity, acceleration, relative)

    @contextmanager
    def profile_moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """Moves by the drives' own profiles, to be changed while they are under way.

        At the end all targets are waited for; the axes end enabled in csp. Whatever is raised
        inside stops all axes. The bus is this thread's meanwhile.

        Args:
            velocity: of the profiles, if nothing else is said [m/s].
            acceleration: both ways [m/s^2].

        Raises:
            AxisFault: the stage is not enabled, an axis faults or does not arrive.
            ConfigurationError: a drive without pp.
        """
        with self._network.lock, self._pp.moves(velocity, acceleration) as moves:
            yield moves


def _check_unique(axes: Sequence[AxisSettings]) -> None:
    if not axes:
        raise ConfigurationError("a stage needs at least one axis")
    nodes: dict[int, str] = {}
    names: set[str] = set()
    for axis in axes:
        if axis.node in nodes:
            raise ConfigurationError(
                f"node {axis.node} is axis {nodes[axis.node]}'s already", axis=axis.name
            )
        if axis.name in names:
            raise ConfigurationError("there are two axes of this name", axis=axis.name)
        nodes[axis.node] = axis.name
        names.add(axis.name)
