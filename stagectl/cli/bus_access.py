"""Bus access of the bench commands (scan, status, check, enable, home, jog).

With `--simulate`, each command gets a virtual stage of its own, on a lock-step bus in virtual time,
whose drives have just been switched on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, BusType

if TYPE_CHECKING:
    from drivers.canopen import Network
    from drivers.settings import AxisSettings, BusSettings
    from drivers.stage import Stage
    from stagectl.config import Machine

_BOOT = 0.1
"""Time for the virtual drives' boot-up messages, which come 20 ms after power-on [s]."""


def bench_options(command: Callable[..., None]) -> Callable[..., None]:
    """`--machine`, `--bus`, `--simulate` and `--seed`; the command takes a `Bench` instead."""

    @wraps(command)
    def with_bench(
        machine: Path | None, bus: tuple[str, str] | None, simulate: bool, seed: int, **others: Any
    ) -> None:
        command(Bench(machine, bus, simulate, seed), **others)

    decorated: Callable[..., None] = with_bench
    for option in (
        click.option("--seed", type=click.IntRange(0), default=1, show_default=True,
                     help="Seed of the virtual stage's noise and start position."),
        click.option("--simulate", is_flag=True, help="Use a virtual stage, in virtual time."),
        click.option("--bus", type=BusType(),
                     help="CAN bus, e.g. socketcan:can0.  [default: the machine file's]"),
        click.option("--machine", type=FILE,
                     help="Machine file of the stage.  [default: wafer-xy]"),
    ):  # fmt: skip
        decorated = option(decorated)
    return decorated


class Bench:
    """A machine and its bus.

    Args:
        machine: its file; None for the packaged one.
        bus: (interface, channel) instead of the machine file's.
        simulate: use a virtual stage instead.
        seed: of the virtual stage.

    Raises:
        click.UsageError: both `bus` and `simulate` are given.
        ConfigError: the machine file cannot be used.
    """

    def __init__(
        self, machine: Path | None, bus: tuple[str, str] | None, simulate: bool, seed: int
    ) -> None:
        from stagectl.config import driver_settings, load_machine

        if simulate and bus is not None:
            raise click.UsageError(
                "--bus cannot be combined with --simulate, which has a bus of its own"
            )
        self.machine: Machine = load_machine(machine)
        self.bus: BusSettings
        self.axes: tuple[AxisSettings, ...]
        self.bus, self.axes = driver_settings(self.machine)
        if bus is not None:
            self.bus = replace(self.bus, interface=bus[0], channel=bus[1])
        self.simulated, self._seed = simulate, seed

    @contextmanager
    def on_bus(self) -> Iterator[BusSettings]:
        """Settings of the bus to open, with virtual drives on it in a simulation.

        Raises:
            UnusableInput: there is no such bus (in place of the driver's error, as below).
            RunFault: bus, node or axis failed.
        """
        from drivers.errors import BusOpenError, DriverError
        from stagectl.errors import RunFault, UnusableInput

        try:
            if not self.simulated:
                yield self.bus
                return
            from hil_sim.bus import World
            from hil_sim.stage import VirtualStage
            from stagectl.config import stage_settings

            world = World(f"bench-{id(self)}")
            VirtualStage(stage_settings(self.machine), self._seed).attach(world)
            world.sleep_until_ns(round(_BOOT * 1e9))
            yield replace(self.bus, interface="lockstep", channel=world.name)
        except BusOpenError as failed:
            raise UnusableInput(str(failed)) from failed
        except DriverError as failed:
            raise RunFault(str(failed)) from failed

    @contextmanager
    def observer(self) -> Iterator[Network]:
        """The bus, without SYNC or heartbeat: the drives do not take this program for their host.

        Raises:
            RunFault: bus, node or axis failed.
        """
        from drivers.canopen import Network, open_bus

        with self.on_bus() as settings:
            bus = open_bus(settings)
            try:
                network = Network(bus, str(settings), beats=False)
                yield network
                network.disconnect()
            finally:
                bus.shutdown()

    @contextmanager
    def stage(self) -> Iterator[Stage]:
        """The stage, not booted; disabled and closed at the end.

        Raises:
            RunFault: bus, node or axis failed.
        """
        from drivers.stage import Stage

        with self.on_bus() as settings, Stage.open(settings, self.axes) as stage:
            yield stage
