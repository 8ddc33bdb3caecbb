"""Stops that get through: by process data, else by SDO, and by themselves where something fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from drivers import objects as od
from drivers.cyclic import Cycle
from drivers.drive import Command
from drivers.errors import AxisFault, BusError
from drivers.motion.fault_report import explained, gather
from drivers.motion.power import Power

PERSISTENCE, PAUSE = 0.6, 0.01
"""A bus that refuses frames may come back, as from bus-off: tried so long, so often [s]. After that
the drives have missed our heartbeat."""
REACTION = 0.5
"""Besides the time for braking, a quick stop may take so long [s]."""


class SafeStop:
    """Takes all axes to rest and takes their power away, whatever else happens.

    Attributes:
        begun: a stop or the closing has begun, and nothing may break it off; until the next boot.
    """

    def __init__(self, cycle: Cycle, power: Power) -> None:
        self.begun = False
        self._clock, self._axes = cycle.clock, cycle.axes
        self._cycle, self._power = cycle, power

    @property
    def braking_time(self) -> float:
        """From the velocity limit to rest at the acceleration limit, slowest axis [s]."""
        return max(a.settings.velocity / a.settings.acceleration for a in self._axes)

    def quick_stop(self) -> None:
        """Stops all axes at their quick-stop deceleration; they end without power.

        Raises:
            AxisFault: an axis does not stop in time.
            BusError: the bus fails.
        """
        self._power.quick_stop(self.braking_time + REACTION)
        self._power.switch_off()

    def disable(self) -> None:
        """Takes the force offsets back, then opens the loops of all axes.

        Raises:
            AxisFault: an axis faults meanwhile, or does not tell that it is without power.
        """
        self._power.ramp_offsets_out()
        self._power.switch_off()
        for axis in self._axes:
            if axis.name in self._power.loose:
                raise AxisFault(
                    "was told to switch off, and neither process data nor SDO show that it has",
                    axis=axis.name, obj=od.STATUSWORD,
                )  # fmt: skip

    def stop(self) -> None:
        """Quick stop and power off wherever it still reaches; never raises."""
        self.begun = True
        if not any(c.seen or c.axis.node.booted for c in self._cycle.channels):
            return  # nobody was ever there: nothing of ours moves
        deadline = self._clock.now_ns() + round(PERSISTENCE * 1e9)
        while not self._attempt() and (now := self._clock.now_ns()) < deadline:
            self._clock.sleep_until_ns(now + round(PAUSE * 1e9))

    def _attempt(self) -> bool:
        """One attempt; False where the bus itself refused, so that another one makes sense."""
        refused = False
        try:
            self.quick_stop()
            return True
        except BusError:
            refused = True
        except Exception:  # noqa: BLE001, S110  whatever it was: try the other way to the drives
            pass
        for command in (Command.QUICK_STOP, Command.DISABLE_VOLTAGE):
            try:
                self._power.attempt_by_sdo(command)
            except Exception:  # noqa: BLE001  nothing is left to try
                break
        return not refused

    def let_go(self) -> None:
        """Disables what may still be under power; never raises."""
        if any(c.seen for c in self._cycle.channels):
            try:
                self.disable() if self._power.enabled else self._power.switch_off()
            except Exception:  # noqa: BLE001
                self.stop()

    @contextmanager
    def on_failure(self) -> Iterator[None]:
        """Whatever goes wrong inside stops all axes; a fault leaves with all that is known of it.

        Raises:
            AxisFault: of the same class, merged by `diagnosis.explained`.
        """
        try:
            yield
        except AxisFault as problem:
            channel = next((c for c in self._cycle.channels if c.axis.name == problem.axis), None)
            if channel is None:
                self.stop()
                raise
            evidence = gather(channel)  # before the stop adds commands of its own
            self.stop()
            raise explained(problem, channel, evidence) from problem
        except BaseException:
            self.stop()
            raise
