"""Bus access of the bench commands (scan, status, check, enable, home, jog).

With `--simulate`, each command gets a virtual stage of its own, on a lock-step bus in virtual time,
whose drives have just been switched on.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.options import FILE, BusType, option
from stagectl.cli.stage_options import TWO_BUSES
from stagectl.errors import drivers_failures

if TYPE_CHECKING:
    import can

    from drivers.canopen import Network
    from drivers.settings import AxisSettings, BusSettings
    from drivers.stage import Stage
    from stagectl.client import Client
    from stagectl.config import Machine

_BOOT = 0.1
"""Time for the virtual drives' boot-up messages, which come 20 ms after power-on [s]."""


@dataclass
class Bench:
    """Options that name a machine and its bus.

    Attributes:
        machine: as its file says.
        settings: of its bus, or of the one named instead.
        axes: of its drives.

    Raises:
        click.UsageError: both --bus and --simulate are given.
        ConfigError: the machine file cannot be used.
    """

    file: Path | None = option(
        "Machine file of the stage.  [default: wafer-xy]", FILE, flags="--machine"
    )
    bus: tuple[str, str] | None = option(
        "CAN bus, e.g. socketcan:can0.  [default: the machine file's]", BusType()
    )
    simulated: bool = option(
        "Use a virtual stage, in virtual time.", default=False, flags="--simulate"
    )
    seed: int = option(
        "Seed of the virtual stage's noise and start position.", click.IntRange(0), 1
    )
    server: str | None = option(
        "Stage server to use.  [default: the one that serves this machine file and bus, if any]",
        metavar="NAME",
    )

    def __post_init__(self) -> None:
        from stagectl.config import driver_settings, load_machine

        if self.simulated and self.bus is not None:
            raise click.UsageError(TWO_BUSES)
        self.machine: Machine = load_machine(self.file)
        self.settings: BusSettings
        self.axes: tuple[AxisSettings, ...]
        self.settings, self.axes = driver_settings(self.machine, self.bus)

    def served(self) -> Client | None:
        """The stage server to use, or None.

        Raises:
            NoServer, UnusableInput: the one named does not run, or serves another machine file.
        """
        from stagectl.cli.served import server_for

        if self.simulated:
            return None
        return server_for(self.machine, self.bus, self.server)

    def axis_at(self, node: int) -> AxisSettings:
        """The axis with a node id, to move it.

        Raises:
            click.BadParameter: the machine file has none.
        """
        for axis in self.axes:
            if axis.node == node:
                return axis
        raise click.BadParameter(
            f"{self.machine.source} has no axis with node id {node}; --move needs its limits",
            param_hint="NODE",
        )

    def require_no_server(self) -> None:
        """For what needs the bus for itself.

        Raises:
            UnusableInput: a stage server owns it.
        """
        from stagectl.cli.served import require_no_server

        require_no_server(self.machine, self.bus)

    @contextmanager
    def on_bus(self) -> Iterator[BusSettings]:
        """Settings of the bus to open, with virtual drives on it in a simulation.

        Raises:
            UnusableInput: there is no such bus (in place of the driver's error, as below).
            RunFault: bus, node or axis failed.
        """
        with drivers_failures():
            if not self.simulated:
                self.require_no_server()
                yield self.settings
                return
            from hil_sim.bus import World
            from hil_sim.stage import VirtualStage
            from stagectl.config import stage_settings

            world = World(f"bench-{id(self)}")
            VirtualStage(stage_settings(self.machine), self.seed).attach(world)
            world.sleep_until_ns(round(_BOOT * 1e9))
            yield replace(self.settings, interface="lockstep", channel=world.name)

    @contextmanager
    def observer(self) -> Iterator[Network]:
        """The bus, without SYNC or heartbeat: the drives do not take this program for their host.

        Raises:
            RunFault: bus, node or axis failed.
        """
        from drivers.canopen import Network, open_bus

        with drivers_failures(), ExitStack() as stack:
            client = self.served()
            if client is not None:
                from stagectl.client.gateway import ServedBus

                bus: can.BusABC = ServedBus(stack.enter_context(client))
                label = client.info.bus
            else:
                settings = stack.enter_context(self.on_bus())
                bus, label = open_bus(settings), str(settings)
            stack.callback(bus.shutdown)
            network = Network(bus, label, beats=False)
            yield network
            network.disconnect()

    @contextmanager
    def stage(self) -> Iterator[Stage]:
        """The stage, not booted; disabled and closed at the end.

        Raises:
            RunFault: bus, node or axis failed.
        """
        from drivers.stage import Stage

        with self.on_bus() as settings, Stage.open(settings, self.axes) as stage:
            yield stage
