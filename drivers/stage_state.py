"""What is known of the stage: where it is, what it was told last, how punctual its bus is."""

from __future__ import annotations

from drivers.clock import Clock
from drivers.stage_parts import StageParts


class StageState:
    """What can be asked of a stage at any time; nothing is sent for it.

    Attributes:
        axes: one `Axis` per settings, in that order; arrays have their columns in it.
    """

    def __init__(self, parts: StageParts) -> None:
        self.axes = parts.axes
        self._network, self._cycle = parts.network, parts.cycle
        self._power, self._real_time = parts.power, parts.real_time

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
