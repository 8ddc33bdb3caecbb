"""What a server serves: machine, bus, data folder and limits; made once, before anything starts.

A run may believe another machine file, such as a twin, of which only the model differs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from drivers.settings import AxisSettings, BusSettings
from stagectl.config import driver_settings, parse_machine
from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
from stagectl.protocol.requests import QueueAdd
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


_OF_THE_PLACE = ("eds", "note", "interface", "channel")
"""Settings that may differ: where a file is, how the bus is reached, remarks."""


def setup_for(setup: Setup, asked: QueueAdd) -> Setup:
    """The setup that a run believes: the server's, or with the machine file that the run names.

    Raises:
        ConfigError: the machine file cannot be used; one line per problem.
        UnusableInput: it asks for another bus or other drives than the server has set up.
    """
    if asked.machine is None:
        return setup
    machine = parse_machine(asked.machine.text, asked.machine.source)
    name = machine.source
    if setup.machine_file is not None:  # files that it names are where the server's are
        machine = parse_machine(asked.machine.text, setup.machine.source)
    bus, axes = driver_settings(machine, setup.named_bus)
    names, here = [axis.name for axis in axes], [axis.name for axis in setup.axes]
    if names != here:
        raise UnusableInput(f"{name}: axes {', '.join(names)}; the server has {', '.join(here)}")
    differing = [*_differences("bus", bus, setup.bus)]
    for asks, has in zip(axes, setup.axes, strict=True):
        differing += _differences(f"axis {has.name}", asks, has)
    if differing:
        raise UnusableInput(
            f"{name}: {'; '.join(differing)}: a run may believe another model, not other "
            "drives; start a server with this file"
        )
    return replace(setup, machine=machine)


def _differences(what: str, asks: Any, has: Any) -> Iterator[str]:
    for field in fields(asks):
        values = getattr(asks, field.name), getattr(has, field.name)
        if field.name not in _OF_THE_PLACE and values[0] != values[1]:
            yield f"{what}: {field.name} {values[0]}, the server has {values[1]}"
