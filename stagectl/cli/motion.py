"""What the commands share that move a stage or its simulation: options, machines, stopping."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, BusType

if TYPE_CHECKING:
    from stagectl.config.machine import Machine

_PACKAGED = "wafer-xy"
_HOSTS_OWN = Path("the host's own")


def simulated_or_real(command: Callable[..., None]) -> Callable[..., None]:
    """The options --machine, --simulate, --bus and --seed, for `machines_of`."""
    for option in (
        click.option("--seed", type=click.IntRange(0), default=1, show_default=True,
                     help="Of the simulation's noise and repeatability."),
        click.option("--bus", type=BusType(),
                     help="Instead of the machine file's, e.g. socketcan:can0."),
        click.option("--simulate", type=FILE, is_flag=False, flag_value=_HOSTS_OWN,
                     metavar="[TRUTH]", help="Run on virtual drives whose plant is this machine "
                     "file [the host's own]."),
        click.option("--machine", type=FILE,
                     help="What the host believes of the stage [wafer-xy]."),
    ):  # fmt: skip
        command = option(command)
    return command


def machines_of(
    machine: Path | None, simulate: Path | None, bus: tuple[str, str] | None, moves: bool = True
) -> tuple[Machine, Machine | None]:
    """What the host believes, and what the virtual stage is: None on a real one.

    Says so where nothing could move, unless nothing is to (`moves`).

    Raises:
        click.UsageError: a simulation was asked for, and a bus too.
        ConfigError: a machine file is unusable, or the two don't fit each other.
    """
    if simulate is not None and bus is not None:
        raise click.UsageError("--bus: --simulate brings its own bus, in virtual time")
    believed = _load(machine)
    if simulate is None:
        if moves and (bus[0] if bus else believed.bus.interface) == "virtual":
            click.echo("a virtual bus is this process' own, without drives: --simulate has them",
                       err=True)  # fmt: skip
        return believed, None
    truth = believed if simulate == _HOSTS_OWN else _load(simulate)
    _check_truth(believed, truth)
    return believed, truth


def stop_on_signal(stop: Callable[[str], None]) -> None:
    """Ctrl-C, SIGTERM and a lost terminal ask for a controlled stop from now on."""

    def handler(number: int, _: Any) -> None:
        name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        stop(f"stopped by the operator ({name})")

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, handler)


def _load(path: Path | None) -> Machine:
    from stagectl.config.machine_file import load_machine

    packaged = path is None or (str(path) == _PACKAGED and not path.exists())
    return load_machine(None if packaged else path)


def _check_truth(believed: Machine, truth: Machine) -> None:
    """The same axes and SYNC, so that host and virtual drives can work together."""
    from stagectl.errors import ConfigError

    if list(truth.axes) != list(believed.axes):
        raise ConfigError(
            f"{truth.source}: axes: {', '.join(truth.axes)}; "
            f"the host's machine file has {', '.join(believed.axes)}"
        )
    for name, axis in truth.axes.items():
        if axis.node != believed.axes[name].node:
            raise ConfigError(
                f"{truth.source}: axes.{name}.node: {axis.node}; "
                f"the host's machine file has {believed.axes[name].node}"
            )
    if truth.bus.sync_period != believed.bus.sync_period:
        raise ConfigError(
            f"{truth.source}: bus.sync_period: {truth.bus.sync_period:g} s; "
            f"the host's machine file has {believed.bus.sync_period:g} s"
        )
