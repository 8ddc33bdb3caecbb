"""Power of a stage: booting, homing and enabling its axes, stopping and disabling them.

A fault of one axis stops all of them.
"""

from __future__ import annotations

from drivers.canopen import MonotonicClock
from drivers.drive import Mode
from drivers.motion import HOLDING_TIMEOUT, home, wait_for_rest
from drivers.stage.session import exclusive
from drivers.stage.watching import StageState


class StagePower(StageState):
    """Boots, homes, enables, stops and disables all axes together."""

    @exclusive
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

    @exclusive
    def home(self, force: bool = False) -> None:
        """Homes all axes that are not homed yet, with `force` all axes.

        They end at rest under power in mode hm; `enable` is next.

        Raises:
            ConfigurationError: a drive has no homing method; before power.
            HomingError: names the axis, the method and what the drive reports.
            AxisFault: any other fault.
        """
        chosen = [c for c in self._cycle.channels if force or not c.axis.homed]
        if not chosen:
            return
        for channel in chosen:
            channel.axis.check_objects(Mode.HOMING)
        with self._stopping.on_failure():
            self._power.enter(Mode.HOMING, chosen)
            home(self._cycle, chosen)
            # homing ends with the drive's demand; csp starts at the actual position, so a following
            # error left by then would become a step of the target
            wait_for_rest(self._cycle, HOLDING_TIMEOUT)
            self._cycle.check_alarms()

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

    @exclusive
    def enable(self) -> None:
        """Enables all axes in csp where they stand; does nothing where they are enabled.

        Where a drive does not offer csp, all hold in pp: `move_to` and `hold` work, streams do not.

        Raises:
            AxisFault: an axis is in fault, or does not become enabled in time.
        """
        mode = Mode.CYCLIC_SYNC_POSITION
        if not all(axis.streams for axis in self.axes):
            mode = Mode.PROFILE_POSITION
        with self._stopping.on_failure():
            if self._power.enabled and self._power.mode is mode:
                self._network.pump(0.0)
                self._cycle.sync.resume()
                self._cycle.exchange()  # the last TPDO may be old
                if self._power.enabled:
                    return
            self._power.enter(mode)

    @exclusive
    def disable(self) -> None:
        """Ramps the force offsets to 0, then switches the power of all axes off.

        Raises:
            AxisFault: an axis faults meanwhile, or does not confirm that its power is off.
        """
        self._stopping.disable()

    @exclusive
    def quick_stop(self) -> None:
        """Stops all axes at their quick-stop deceleration and switches their power off.

        Raises:
            AxisFault: an axis does not stop in time.
            BusError: the bus fails.
        """
        self._stopping.quick_stop()

    @exclusive
    def halt(self) -> None:
        """Stops all axes by controlword bit 8 (0x605D); they hold where they come to rest.

        Raises:
            AxisFault: the stage is not enabled, or an axis does not come to rest; all are stopped.
        """
        self._power.require_enabled()
        self._stopping.halt()

    @exclusive
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
