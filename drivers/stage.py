"""The stage as the application sees it: its axes are booted, homed, enabled and stopped together.

A fault of one axis stops all of them. Streams are csp (0x607A and 0x60B2 with every SYNC), on
request csv or cst; pp serves jogging. The host's heartbeat is sent while a method runs; the drives
stop by themselves after 0.5 s without it (`idle` waits with heartbeats). One thread at a time uses
the bus, but objects can be read and written from any thread (`axis.node`), during a stream between
its SYNCs.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Concatenate, ParamSpec, TypeVar

import can
import numpy as np

from drivers.boot import Boot
from drivers.canopen import MonotonicClock, Network, Tap, open_bus
from drivers.cyclic import Cycle, OffsetCorrection, RealTime, Sink, Until
from drivers.drive import Axis, Mode
from drivers.errors import BusError, ConfigurationError, DriverError
from drivers.motion import CyclicModes, Homing, Power, ProfileMoves, ProfilePosition, SafeStop
from drivers.settings import AxisSettings, BusSettings
from stagedata import F64, Samples

P = ParamSpec("P")
R = TypeVar("R")


def _exclusive(
    method: Callable[Concatenate[Stage, P], R],
) -> Callable[Concatenate[Stage, P], R]:
    """Keeps the bus locked for the whole operation, so that no other thread reads it."""

    @functools.wraps(method)
    def locked(stage: Stage, /, *args: P.args, **kwargs: P.kwargs) -> R:
        with stage._network.lock:  # noqa: SLF001  a method's wrapper
            return method(stage, *args, **kwargs)

    return locked


class Stage:
    """All axes on one bus; a context manager that disables the axes and closes the bus at its end.

    Attributes:
        axes: one `Axis` per settings, in the order of all array columns.
        clock: of the bus: virtual on the lock-step bus, else monotonic.
        sink: called with the `Sample` of every SYNC of a csp stream, before it is evaluated.
        interrupt: called at least every 25 ms while a method uses the bus; what it raises ends
            the method, and stops axes that are enabled.
    """

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
        self._cycle = cycle = Cycle(self._network, self.axes, bus)
        self._start = Boot(self._network, cycle, self.axes, bus)
        self._power = power = Power(cycle)
        self._real_time = real_time = RealTime(bus.realtime)
        self._stopping = stopping = SafeStop(cycle, power)
        self._homing = Homing(cycle, power, stopping)
        self._cyclic = CyclicModes(cycle, power, stopping, real_time)
        self._pp = ProfilePosition(cycle, power, stopping, self._cyclic.enter_csp)

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
    ) -> Stage:
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

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and self._open:
            self.safe_stop()
        self.close()

    # -- state, as last received; nothing is sent -----------------------------------------------

    @property
    def enabled(self) -> bool:
        """Whether all axes were last seen in OPERATION ENABLED."""
        return self._power.enabled

    @property
    def homed(self) -> bool:
        """Whether all axes have been homed since their last boot-up."""
        return all(axis.homed for axis in self.axes)

    @property
    def positions(self) -> tuple[float, ...]:
        """Actual positions of the last sample [m]."""
        return tuple(c.position * c.axis.increment for c in self._cycle.channels)

    @property
    def statuswords(self) -> tuple[int | None, ...]:
        """Statuswords (0x6041) of the last sample; None before the first."""
        return tuple(c.statusword if c.seen else None for c in self._cycle.channels)

    @property
    def forces(self) -> tuple[float, ...]:
        """Actual forces of the last sample [N]."""
        return tuple(c.force * c.axis.force_unit for c in self._cycle.channels)

    @property
    def targets(self) -> tuple[float, ...]:
        """Target positions sent last [m]; the next stream has to start there."""
        return tuple(c.target * c.axis.increment for c in self._cycle.channels)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Force offsets sent last [N]."""
        return tuple(c.offset * c.axis.force_unit for c in self._cycle.channels)

    @property
    def limitations(self) -> tuple[str, ...]:
        """What the drives lack and what follows from it, one clause each; known after `boot`."""
        return tuple(f"axis {a.name}: {clause}" for a in self.axes for clause in a.limitations)

    @property
    def notices(self) -> tuple[str, ...]:
        """Warnings of drives, unmet requests on SYNC and real time; one clause each, in motion."""
        corrected = self._cycle.corrected
        failed = () if corrected is None or corrected.failure is None else (corrected.failure,)
        warned = [f"axis {a.name}: {text}" for a in self.axes for text in a.node.warnings]
        return (*warned, *self._real_time.refused, *self._cycle.sync.notices, *failed)

    @property
    def missed(self) -> int:
        """Samples missed since opening."""
        return self._cycle.sync.reception.missed

    @property
    def late(self) -> int:
        """SYNCs that left more than half a period late since opening."""
        return self._cycle.sync.late

    def correct_offsets(self, correction: OffsetCorrection | None) -> None:
        """Has the force offsets of all further csp streams corrected from SYNC to SYNC.

        Args:
            correction: chooses each row's offsets after the sample before it; None: no longer. If
                it fails, its last correction stays in effect, and `notices` says so.
        """
        self._cycle.correct_offsets(correction)

    # -- life cycle -------------------------------------------------------------------------

    @_exclusive
    def boot(self) -> None:
        """Resets, identifies and configures all nodes and makes them OPERATIONAL.

        Raises:
            NodeError: a node is missing, refuses an access, is another device, or two devices
                share its id.
            ConfigurationError: a drive cannot be configured as needed.
            BusError: the bus fails, or another host is on it.
        """
        self._stopping.begun = False
        self._network.other_host.found = None
        self._network.beats = True
        self._start.listen()
        self._power.mode = None
        if isinstance(self.clock, MonotonicClock):
            self._real_time.begin()
        self._start.run()

    @_exclusive
    def home(self, force: bool = False) -> None:
        """Homes all axes that are not homed yet, with `force` all axes.

        They end at rest under power in mode hm; `enable` is next.

        Raises:
            ConfigurationError: a drive has no homing method; before power.
            HomingError: names the axis, the method and what the drive reports.
            AxisFault: any other fault.
        """
        self._homing.home(force)

    @_exclusive
    def check_move_to(self, axis: str, velocity: float, acceleration: float) -> None:
        """Checks, before power, that `move_to` can move an axis of the booted stage.

        The profile is written to the drive, which shows whether it takes it.

        Args:
            axis: its name.
            velocity: of the profile [m/s].
            acceleration: of the profile, also for braking [m/s^2].

        Raises:
            LimitError: velocity or acceleration is outside the axis' limits, or nothing in the
                drive's units.
            ConfigurationError: its drive lacks mode pp or an object of its profile, or holds a
                faster one.
            NodeError: no answer, or the drive refuses the profile.
        """
        self._pp.check(axis, velocity, acceleration)

    @property
    def streams(self) -> bool:
        """Whether all drives of the booted stage offer csp; else they hold and move in pp."""
        return all(axis.streams for axis in self.axes)

    def require_csp(self) -> None:
        """Checks, before power, that the booted stage can stream positions.

        Raises:
            ConfigurationError: a drive does not offer csp.
        """
        for axis in self.axes:
            axis.require_csp()

    @_exclusive
    def enable(self) -> None:
        """Enables all axes in csp where they stand; does nothing where they are enabled.

        Where a drive does not offer csp, all hold in pp: `move_to` and `hold` work, streams do not.

        Raises:
            AxisFault: an axis is in fault, or does not become enabled in time.
        """
        self._cyclic.enter_csp()

    @_exclusive
    def disable(self) -> None:
        """Ramps the force offsets to 0, then switches the power of all axes off.

        Raises:
            AxisFault: an axis faults meanwhile, or does not confirm that its power is off.
        """
        self._stopping.disable()

    @_exclusive
    def quick_stop(self) -> None:
        """Stops all axes at their quick-stop deceleration and switches their power off.

        Raises:
            AxisFault: an axis does not stop in time.
            BusError: the bus fails.
        """
        self._stopping.quick_stop()

    @_exclusive
    def halt(self) -> None:
        """Stops all axes by controlword bit 8 (0x605D); they hold where they come to rest.

        Raises:
            AxisFault: the stage is not enabled, or an axis does not come to rest; all are stopped.
        """
        self._power.require_enabled()
        if self._power.mode is Mode.PROFILE_POSITION:
            self._pp.halt()
        else:
            self._stopping.halt()

    @_exclusive
    def reset_faults(self) -> None:
        """Makes all nodes OPERATIONAL and acknowledges all faults; `enable` is next.

        Raises:
            AxisFault: a fault persists.
            NodeError: a node does not become OPERATIONAL.
        """
        self._network.other_host.found = None
        self._network.beats = True
        for axis in self.axes:
            axis.node.start()  # a drive that missed the host's heartbeat has left OPERATIONAL
        with self._stopping.on_failure():
            self._power.reset_faults()

    @_exclusive
    def idle(self, duration: float) -> None:
        """Waits for `duration` [s] while heartbeats are sent and watched.

        Raises:
            AxisFault: an axis raises an alarm.
        """
        with self._stopping.on_failure():
            self._network.pump(duration)
            self._cycle.check_alarms()

    @_exclusive
    def watch(self, duration: float, checked: bool = True) -> None:
        """As `idle`, with SYNC, so that positions are seen: of a booted stage without power.

        Args:
            duration: in time of the bus [s].
            checked: whether alarms and missing process data are raised.

        Raises:
            AxisFault: an axis raises an alarm, or sends no process data.
            BusError: the bus fails.
        """
        with self._stopping.on_failure():
            for _ in self._cycle.cycles(duration, checked):
                self._interrupted(0)

    @_exclusive
    def safe_stop(self) -> None:
        """Quick-stops all axes and switches them off, as far as they are reached; never raises."""
        self._stopping.stop()

    @_exclusive
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

    # -- motion -----------------------------------------------------------------------------

    @_exclusive
    def stream(
        self,
        position: F64,
        offset: F64,
        until: Until | None = None,
    ) -> Samples:
        """Streams setpoints in csp, one row per SYNC, and returns the samples.

        Consecutive streams continue the same SYNC grid. Sample k is taken at SYNC k, at which the
        drives also take row k over.

        Args:
            position: float64[K, n] target positions [m].
            offset: float64[K, n] force offsets [N].
            until: gets the actual positions [m] after each SYNC; True ends the stream.

        Raises:
            LimitError: a setpoint is outside the limits; nothing was sent.
            AxisFault: an axis faulted or fell silent; all axes are stopped.
            BusError: the bus failed; the drives stop when they miss the host's heartbeat.
        """
        return self._cyclic.stream_position(position, offset, until, self.sink)

    @_exclusive
    def stream_velocity(
        self,
        velocity: F64,
        offset: F64 | None = None,
        until: Until | None = None,
    ) -> Samples:
        """Streams velocities in csv, from rest to rest; the axes stay enabled in csv.

        `enable` returns them to csp. The sink gets none of these samples.

        Args:
            velocity: float64[K, n] [m/s]; the last row is 0.
            offset: float64[K, n] force offsets [N], 0 by default.
            until: as for `stream`; the axes then brake at their acceleration limit.

        Raises:
            LimitError: outside velocity, acceleration or travel; nothing was sent.
            ConfigurationError: a drive does not offer csv.
            AxisFault, BusError: as `stream`.
        """
        return self._cyclic.stream_velocity(velocity, offset, until)

    @_exclusive
    def stream_force(self, force: F64, until: Until | None = None) -> Samples:
        """Streams forces in cst; the axes stay enabled in cst, without force.

        `enable` waits for rest and returns them to csp. The sink gets none of these samples.

        Args:
            force: float64[K, n] [N]; the last row is 0.
            until: as for `stream`; the force is then 0 at once.

        Raises:
            LimitError: above the peak force; nothing was sent.
            ConfigurationError: a drive does not offer cst.
            AxisFault: as `stream`; or an axis exceeded its velocity limit, or could no longer stop
                within its travel.
            BusError: as `stream`.
        """
        return self._cyclic.stream_force(force, until)

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

        All axes end enabled in csp, this one holding the target.

        Args:
            axis: its name.
            position: absolute [m], or several positions, each begun when the previous one is
                reached.
            velocity: of the profile [m/s].
            acceleration: of the profile, also for braking [m/s^2].
            relative: positions count from the previous target, the first from the actual position.

        Raises:
            LimitError: outside the axis' limits; nothing was sent.
            ConfigurationError: the drive does not offer pp, or lacks an object of its profile;
                nothing was changed.
            AxisFault: the axis faulted or did not arrive; all axes are stopped.
        """
        self._pp.move_to(axis, position, velocity, acceleration, relative)

    @_exclusive
    def stream_to(
        self,
        targets: Sequence[float],
        velocity: Sequence[float],
        acceleration: Sequence[float],
        until: Until | None = None,
    ) -> Samples:
        """Moves all axes at once by their drives' own profiles (pp), with a sample of every SYNC.

        For a stage that holds in pp, having a drive without csp. The samples' demand is the target,
        from the first one on.

        Args:
            targets: [m], one per axis.
            velocity: of each axis' profile [m/s].
            acceleration: of each axis' profile, also for braking [m/s^2].
            until: gets the actual positions [m] after each SYNC; True halts the axes where they
                come to rest.

        Raises:
            LimitError: outside an axis' limits; nothing was sent.
            AxisFault: the stage is not enabled in pp, an axis faulted or did not arrive; all axes
                are stopped.
        """
        return self._pp.stream_to(targets, velocity, acceleration, until, self.sink)

    @contextmanager
    def profile_moves(self, velocity: float, acceleration: float) -> Iterator[ProfileMoves]:
        """Moves by the drives' own profiles whose targets may change on the way.

        The end of the block waits for all targets; the axes then are enabled in csp. An exception
        inside stops all axes. Other threads cannot use the bus meanwhile.

        Args:
            velocity: default of the profiles [m/s].
            acceleration: default of the profiles, also for braking [m/s^2].

        Raises:
            AxisFault: the stage is not enabled, an axis faults or does not arrive.
            ConfigurationError: a drive does not offer pp.
        """
        with self._network.lock, self._pp.moves(velocity, acceleration) as moves:
            yield moves


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
