"""What a stage shows: the state of its axes as last received, and waiting while it is watched."""

from __future__ import annotations

from drivers.stage.session import StageSession, exclusive


class StageState(StageSession):
    """The state of all axes. Properties say what was received last; nothing is sent."""

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

    @exclusive
    def idle(self, duration: float) -> None:
        """Waits for `duration` [s] while heartbeats are sent and watched.

        Raises:
            AxisFault: an axis raises an alarm.
        """
        with self._stopping.on_failure():
            self._network.pump(duration)
            self._cycle.check_alarms()

    @exclusive
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
