"""The stage as the application sees it: axes booted, homed, enabled, streamed and stopped together.

A fault of one axis stops all of them. Setpoints are csp (0x607A and 0x60B2, one pair a SYNC); pp
and hm serve jogging and homing. The host's heartbeat goes out while something here runs, and the
drives stop by themselves when the host stays silent for 0.5 s (`idle` waits without that). One
thread at a time has the bus; objects can be read and written from any thread meanwhile
(`axis.node`), during a stream between its SYNCs.
"""

from __future__ import annotations

import functools
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Concatenate, ParamSpec, TypeVar

import can
import numpy as np
from numpy.typing import NDArray

from drivers import direct, homing, profile_position
from drivers import objects as od
from drivers.axis import Axis
from drivers.bus import Network, Tap, open_bus
from drivers.channel import Channel
from drivers.cia402 import Command, Mode, State
from drivers.clock import Clock, MonotonicClock
from drivers.cycle import Cycle, Sink, Until
from drivers.diagnosis import Evidence, explained
from drivers.errors import AxisFault, BusError, ConfigurationError, DriverError
from drivers.limits import (
    checked_counts,
    checked_forces,
    checked_profile,
    checked_velocities,
)
from drivers.power import HOLDING_TIMEOUT, RINGING_TIMEOUT, Power
from drivers.realtime import RealTime
from drivers.samples import Samples
from drivers.settings import AxisSettings, BusSettings

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
        ending: a stop or the closing has begun, and nothing may break it off; until the next boot.
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
        self._open = True
        self.ending = False
        _check_unique(axes)
        self._network = Network(bus_object, str(bus), tap)
        self.axes = tuple(Axis(self._network, axis) for axis in axes)
        self._cycle = Cycle(self._network, self.axes, bus)
        self._real_time = RealTime(bus.realtime)
        self._power = Power(self._cycle, bus.sync_period)

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

    # -- state ------------------------------------------------------------------------------

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
            NodeError: a node is missing, refuses an access, or is another device.
            ConfigurationError: a drive cannot be set up as needed.
        """
        self.ending = False
        self._cycle.sync.stop()
        self._cycle.forget()
        self._power.mode = None
        if isinstance(self.clock, MonotonicClock):
            self._real_time.begin()
        for axis in self.axes:
            axis.node.boot()
        for axis in self.axes:
            axis.configure(self.settings)
        for channel in self._cycle.channels:
            channel.adapt()
        self._network.service(self._network.clock.now_ns())
        for axis in self.axes:
            axis.node.start()
        self._cycle.clear_alarms()

    @_exclusive
    def home(self, force: bool = False) -> None:
        """Homes all axes that are not homed yet (all with `force`).

        They end at rest under power, in mode hm: `enable` is the next step.

        Raises:
            HomingError: names the axis, its method and what the drive says.
            AxisFault: any other fault on the way.
        """
        chosen = [c for c in self._cycle.channels if force or not c.axis.homed]
        if not chosen:
            return
        with self._stopping():
            self._enter(Mode.HOMING, chosen)
            homing.home(self._cycle, chosen, self.settings.sync_period)
            # the drive is done when its demand is; what the loop still owes would become a
            # step of the target when csp takes over from the actual position
            self._power.wait_for_rest(HOLDING_TIMEOUT)
            self._cycle.check_alarms()

    @_exclusive
    def enable(self) -> None:
        """Closes the loops of all axes in csp where they stand; harmless when enabled already.

        Raises:
            AxisFault: an axis is in fault, or does not get there.
        """
        with self._stopping():
            if self._power.enabled and self._power.mode is Mode.CYCLIC_SYNC_POSITION:
                self._network.pump(0.0)
                self._cycle.resume()
                self._cycle.exchange()  # what was last heard may be long ago
                if self._power.enabled:
                    return
            self._enter(Mode.CYCLIC_SYNC_POSITION, self._cycle.channels)

    def _enter(self, mode: Mode, channels: Sequence[Channel]) -> None:
        """Axes enabled in the new mode.

        Enabled ones change over under power, or presliding would throw them back by some 10 um;
        where a drive refuses that, all go by SWITCH ON DISABLED.
        """
        self._network.pump(0.0)
        self._cycle.clear_alarms()
        if self._power.change_over(mode, channels):
            return
        self._power.switch_off()
        self._power.wait_for_rest(RINGING_TIMEOUT)
        self._power.set_mode(mode)
        self._power.go(State.OPERATION_ENABLED, channels)

    @_exclusive
    def disable(self) -> None:
        """Takes the force offsets back, then opens the loops of all axes.

        Raises:
            AxisFault: an axis faults meanwhile, or does not tell that it is without power.
        """
        self._power.ramp_offsets_out()
        self._power.switch_off()
        self._check_loose()

    @_exclusive
    def quick_stop(self) -> None:
        """Stops all axes at their quick-stop deceleration; they end without power.

        Raises:
            AxisFault: an axis does not stop in time.
            BusError: the bus fails.
        """
        self._power.quick_stop(self._stopping_time() + 0.5)
        self._power.switch_off()

    @_exclusive
    def halt(self) -> None:
        """Stops all axes by controlword bit 8 (0x605D); they end holding where they stand.

        Raises:
            AxisFault: the stage is not enabled, or an axis does not come to rest; all are stopped.
        """
        if not self.enabled:
            raise AxisFault("the stage is not enabled", axis=self._not_enabled())
        with self._stopping():
            self._power.halt(10 * self._stopping_time() + HOLDING_TIMEOUT)

    @_exclusive
    def reset_faults(self) -> None:
        """Makes all nodes OPERATIONAL again and acknowledges all faults; `enable` is next.

        Raises:
            AxisFault: a fault stays.
            NodeError: a node does not become OPERATIONAL.
        """
        for axis in self.axes:
            axis.node.start()  # a drive that missed the host's heartbeat has left it
        with self._stopping():
            self._power.reset_faults()

    @_exclusive
    def idle(self, duration: float) -> None:
        """Waits for `duration` [s], keeping heartbeats up both ways.

        Raises:
            AxisFault: an axis says something meanwhile.
        """
        with self._stopping():
            self._network.pump(duration)
            self._cycle.check_alarms()

    @_exclusive
    def safe_stop(self) -> None:
        """Quick stop and power off wherever it still reaches; never raises."""
        self.ending = True
        if not any(c.seen or c.axis.node.booted for c in self._cycle.channels):
            return  # nobody was ever there: nothing of ours moves
        try:
            self.quick_stop()
        except Exception:  # noqa: BLE001  whatever broke the bus: try the other way to the drives
            for command in (Command.QUICK_STOP, Command.DISABLE_VOLTAGE):
                try:
                    self._power.attempt_by_sdo(command)
                except Exception:  # noqa: BLE001  nothing is left to try
                    return

    @_exclusive
    def close(self) -> None:
        """Stops and disables what is still moving, lets go of nodes and bus; never raises."""
        if not self._open:
            return
        self._open, self.ending = False, True
        if any(c.seen for c in self._cycle.channels):
            try:
                self.disable() if self.enabled else self._power.switch_off()
            except Exception:  # noqa: BLE001
                self.safe_stop()
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
        channels = self._cycle.channels
        axes = [c.axis.settings for c in channels]
        if not self.enabled:
            raise AxisFault("the stage is not enabled", axis=self._not_enabled())
        if self._power.mode is not Mode.CYCLIC_SYNC_POSITION:
            raise AxisFault("the stage is not in csp: enable it first", axis=self.axes[0].name)
        targets, offsets = checked_counts(
            position, offset, axes, [c.target for c in channels], self.settings.sync_period
        )
        rows = array("q")
        with self._stopping(), self._real_time.in_motion():
            self._cycle.stream(targets, offsets, rows, self.sink, until)
        return Samples.from_rows(rows, [c.axis.scale for c in channels])

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
        velocity = np.asarray(velocity, dtype=np.float64)
        targets, offsets = checked_velocities(
            velocity, np.zeros_like(velocity) if offset is None else offset,
            [a.settings for a in self.axes], self.positions, self.settings.sync_period,
        )  # fmt: skip
        return self._stream_directly(Mode.CYCLIC_SYNC_VELOCITY, targets, offsets, until)

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
        targets = checked_forces(force, [a.settings for a in self.axes])
        guard = direct.Guard(self._cycle.channels, self.clock, until)
        return self._stream_directly(
            Mode.CYCLIC_SYNC_TORQUE, targets, np.zeros_like(targets), guard
        )

    def _stream_directly(
        self,
        mode: Mode,
        targets: NDArray[np.int64],
        offsets: NDArray[np.int64],
        until: Until | None,
    ) -> Samples:
        if not self.enabled:
            raise AxisFault("the stage is not enabled", axis=self._not_enabled())
        for axis in self.axes:
            axis.check_mode(mode)
        with self._stopping(), self._real_time.in_motion():
            if self._power.mode is not mode:
                self._enter(mode, self._cycle.channels)
            return direct.stream(self._cycle, targets, offsets, until, self.settings.sync_period)

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
        channel = self._channel(axis)
        wanted = [position] if isinstance(position, int | float) else list(position)
        start = channel.position * channel.axis.scale.increment
        setpoints = checked_profile(
            channel.axis.settings, start, wanted, velocity, acceleration, relative
        )
        with self._stopping():
            channel.axis.set_profile(velocity, acceleration)
            self._enter(Mode.PROFILE_POSITION, self._cycle.channels)
            profile_position.move(self._cycle, channel, setpoints, self.settings.sync_period)
        self.enable()

    def _stopping_time(self) -> float:
        """From the velocity limit to rest at the acceleration limit, slowest axis [s]."""
        return max(a.settings.velocity / a.settings.acceleration for a in self.axes)

    def _channel(self, axis: str) -> Channel:
        for channel in self._cycle.channels:
            if channel.axis.name == axis:
                return channel
        names = ", ".join(a.name for a in self.axes)
        raise ConfigurationError(f"no such axis (there are {names})", axis=axis)

    def _not_enabled(self) -> str:
        from drivers.power import state_of

        for channel in self._cycle.channels:
            if not channel.seen or state_of(channel) is not State.OPERATION_ENABLED:
                return channel.axis.name
        return self.axes[0].name

    def _check_loose(self) -> None:
        for axis in self.axes:
            if axis.name in self._power.loose:
                raise AxisFault(
                    "was told to switch off, and neither process data nor SDO show that it has",
                    axis=axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    @contextmanager
    def _stopping(self) -> Iterator[None]:
        """Whatever goes wrong inside stops all axes; a fault leaves with all that is known of it.

        Raises:
            AxisFault: of the same class, merged by `diagnosis.explained`.
        """
        try:
            yield
        except AxisFault as problem:
            channel = next((c for c in self._cycle.channels if c.axis.name == problem.axis), None)
            if channel is None:
                self.safe_stop()
                raise
            evidence = Evidence.of(channel)  # before the stop adds commands of its own
            self.safe_stop()
            raise explained(problem, channel, evidence) from problem
        except BaseException:
            self.safe_stop()
            raise


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
