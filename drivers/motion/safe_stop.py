"""Safe stops: by process data, else by SDO, repeated where the bus refuses frames.

Source: CiA 402-2, quick stop and disable voltage of 0x6040; option codes 0x605A to 0x605E.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from drivers import objects as od
from drivers.cyclic import Cycle
from drivers.drive import Command
from drivers.errors import AxisFault, BusError
from drivers.motion.fault_report import complete, gather
from drivers.motion.power import HOLDING_TIMEOUT, Power
from drivers.motion.standstill import halt

RETRY_TIME, RETRY_PAUSE = 0.6, 0.01
"""Where the bus refuses frames, a stop is repeated for so long at these intervals [s]: the bus may
recover, as from bus-off. After that time the drives have missed our heartbeat."""
REACTION = 0.5
"""Duration of a quick stop, braking not included [s]."""


class SafeStop:
    """Brings all axes to rest and switches their power off, whatever else happens.

    Attributes:
        begun: a stop or the closing has begun, which must not be interrupted; until the next boot.
    """

    def __init__(self, cycle: Cycle, power: Power) -> None:
        self.begun = False
        self._clock, self._axes = cycle.clock, cycle.axes
        self._cycle, self._power = cycle, power

    @property
    def braking_time(self) -> float:
        """Time of the slowest axis from its velocity limit to rest [s]."""
        return max(a.settings.velocity / a.settings.acceleration for a in self._axes)

    def quick_stop(self) -> None:
        """Stops all axes at their quick-stop deceleration and switches their power off.

        Raises:
            AxisFault: an axis does not stop in time.
            BusError: the bus fails.
        """
        self._power.quick_stop(self.braking_time + REACTION)
        self._power.switch_off()

    def halt(self) -> None:
        """Stops all axes by controlword bit 8 (0x605D); they stay enabled.

        Raises:
            AxisFault: an axis does not come to rest; all are stopped.
        """
        with self.on_failure():
            halt(self._cycle, self.halt_timeout)

    @property
    def halt_timeout(self) -> float:
        """Longest time in which axes come to rest by a halt [s]."""
        return 10 * self.braking_time + HOLDING_TIMEOUT

    def disable(self) -> None:
        """Ramps the force offsets to 0, then switches the power of all axes off.

        Raises:
            AxisFault: an axis faults meanwhile, or does not confirm that its power is off.
        """
        self._power.ramp_offsets_out()
        self._power.switch_off()
        for axis in self._axes:
            if axis.name in self._power.unconfirmed:
                raise AxisFault(
                    "was commanded to switch off; neither process data nor SDO confirm it",
                    axis=axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def stop(self) -> None:
        """Quick-stops all axes and switches them off, as far as they are reached; never raises."""
        self.begun = True
        if not any(c.seen or c.axis.node.booted for c in self._cycle.channels):
            return  # no drive was ever heard, so none was enabled
        deadline = self._clock.now_ns() + round(RETRY_TIME * 1e9)
        while not self._attempt() and (now := self._clock.now_ns()) < deadline:
            self._clock.sleep_until_ns(now + round(RETRY_PAUSE * 1e9))

    def _attempt(self) -> bool:
        """One attempt; False where the bus refused frames, so that another one may succeed."""
        refused = False
        try:
            self.quick_stop()
            return True
        except BusError:
            refused = True
        except Exception:  # noqa: BLE001, S110  whatever it was, SDO may still get through
            pass
        for command in (Command.QUICK_STOP, Command.DISABLE_VOLTAGE):
            try:
                self._power.attempt_by_sdo(command)
            except Exception:  # noqa: BLE001  nothing is left to try
                break
        return not refused

    def disable_or_stop(self) -> None:
        """Disables what may still be under power, else stops it; never raises."""
        if any(c.seen for c in self._cycle.channels):
            try:
                self.disable() if self._power.enabled else self._power.switch_off()
            except Exception:  # noqa: BLE001
                self.stop()

    @contextmanager
    def on_failure(self) -> Iterator[None]:
        """Stops all axes on any exception inside; a fault is raised with all that is known of it.

        Raises:
            AxisFault: of the same class, completed by `fault_report.complete`.
        """
        try:
            yield
        except AxisFault as problem:
            channel = next((c for c in self._cycle.channels if c.axis.name == problem.axis), None)
            if channel is None:
                self.stop()
                raise
            report = gather(channel)  # before the stop sends commands of its own
            self.stop()
            raise complete(problem, channel, report) from problem
        except BaseException:
            self.stop()
            raise
