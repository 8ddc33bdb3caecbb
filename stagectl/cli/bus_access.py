"""How the commands for a stage on its bench get at its bus: options, an onlooker, a stage.

`--simulate` puts the virtual stage on a lock-step bus in virtual time, made for this one command:
its drives have just been switched on.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from stagectl.cli.options import FILE, BusType

if TYPE_CHECKING:
    from drivers.canopen import Network
    from drivers.settings import AxisSettings, BusSettings
    from drivers.stage import Stage
    from stagectl.config.machine import Machine

F = TypeVar("F", bound=Callable[..., Any])

_BOOT = 0.1
"""Virtual drives need 20 ms from power-on to their boot-up message [s]."""


def bus_options(command: F) -> F:
    """`--machine`, `--bus`, `--simulate`, `--seed`."""
    for option in (
        click.option("--seed", type=click.IntRange(0), default=1, show_default=True,
                     help="Of the virtual stage's noise and start position."),
        click.option("--simulate", is_flag=True, help="On the virtual stage, in virtual time."),
        click.option("--bus", type=BusType(), help="Instead of the machine file's."),
        click.option("--machine", type=FILE, help="Machine file of the stage [wafer-xy]."),
    ):  # fmt: skip
        command = option(command)
    return command


class Bench:
    """A machine and the bus that it is on.

    Args:
        machine: its file, None for the packaged one.
        bus: (interface, channel) instead of the machine's.
        simulate: on the virtual stage instead.
        seed: of the virtual stage.

    Raises:
        click.UsageError: both `bus` and `simulate`.
        ConfigError: the machine file cannot be used.
    """

    def __init__(
        self, machine: Path | None, bus: tuple[str, str] | None, simulate: bool, seed: int
    ) -> None:
        from stagectl.config.machine_file import load_machine
        from stagectl.config.mapping import driver_settings

        if simulate and bus is not None:
            raise click.UsageError("--bus: --simulate brings its own bus, in virtual time")
        self.machine: Machine = load_machine(machine)
        self.bus: BusSettings
        self.axes: tuple[AxisSettings, ...]
        self.bus, self.axes = driver_settings(self.machine)
        if bus is not None:
            self.bus = replace(self.bus, interface=bus[0], channel=bus[1])
        self._simulate, self._seed = simulate, seed

    @contextmanager
    def on_bus(self) -> Iterator[BusSettings]:
        """The bus to open, virtual drives on it where asked for; driver errors become ours.

        Raises:
            RunFault: bus, node or axis failed.
        """
        from drivers.errors import DriverError
        from stagectl.errors import RunFault

        try:
            if not self._simulate:
                yield self.bus
                return
            from hil_sim.bus import World
            from hil_sim.stage import VirtualStage
            from stagectl.config.mapping import stage_settings

            world = World(f"bench-{id(self)}")
            VirtualStage(stage_settings(self.machine), self._seed).attach(world)
            world.sleep_until_ns(round(_BOOT * 1e9))
            yield replace(self.bus, interface="lockstep", channel=world.name)
        except DriverError as failed:
            raise RunFault(str(failed)) from failed

    @contextmanager
    def onlooker(self) -> Iterator[Network]:
        """The bus without a SYNC and without a heartbeat: drives don't take us for their host.

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
        """The stage, not booted yet; disabled and closed at the end.

        Raises:
            RunFault: bus, node or axis failed.
        """
        from drivers.stage import Stage

        with self.on_bus() as settings, Stage.open(settings, self.axes) as stage:
            yield stage


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Ctrl-C interrupts what is under way; the drives are stopped on the way out.

    A second one does not break that off: once it came, Ctrl-C is heard no more.

    Gives a function that says from then on to wait for Ctrl-C instead, and whether it came.
    """
    asked = waited_for = False

    def stopped() -> bool:
        nonlocal waited_for
        waited_for = True
        return asked

    def handler(number: int, _: Any) -> None:
        nonlocal asked
        if asked:
            return
        asked = True
        if not waited_for:
            raise KeyboardInterrupt

    before = {n: signal.signal(n, handler) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    except KeyboardInterrupt:
        raise click.exceptions.Abort from None
    finally:
        if not asked:
            for number, former in before.items():
                signal.signal(number, former)
