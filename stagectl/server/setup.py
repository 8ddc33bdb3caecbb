"""What a server serves: machine, bus, data folder and limits; made once, before anything starts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivers.settings import AxisSettings, BusSettings
from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
from stagectl.server.keeper import Simulated

HOLD_LIMIT, PAUSE_LIMIT = 600.0, 600.0
"""Defaults of the two limits on holding [s]."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What to serve.

    Attributes:
        machine: the stage as the host believes it to be.
        machine_file: its path; None for the packaged one.
        bus, axes: settings of the drivers.
        named_bus: (interface, channel) in place of the machine's, or None.
        simulated: the virtual stage, or None.
        data: folder of runs and queue.
        hold_limit: how long idle axes are held [s].
        pause_limit: how long a run may be paused [s].
        statistics: file for how well the paced virtual drives kept to the clock; None for none.
    """

    machine: Machine
    machine_file: Path | None
    bus: BusSettings
    axes: tuple[AxisSettings, ...]
    named_bus: tuple[str, str] | None
    simulated: Simulated | None
    data: Path
    hold_limit: float = HOLD_LIMIT
    pause_limit: float = PAUSE_LIMIT
    statistics: Path | None = None

    def check(self) -> None:
        """Refuse drives that would go on without their host.

        Raises:
            UnusableInput: the machine file accepts such a drive.
        """
        for axis in self.axes:
            if axis.unwatched_host and self.simulated is None:
                raise UnusableInput(
                    f"{self.machine.source}: axes.{axis.name}.drive.unwatched_host: a server does "
                    "not hold a drive that would go on when it dies"
                )
