"""Options, machine files and stop signals of the commands that move a stage or a simulation."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, BusType

if TYPE_CHECKING:
    from stagectl.config import Machine

_PACKAGED = "wafer-xy"
_SAME_AS_HOST = Path("same as the host")
"""`--simulate` without a value."""


def stage_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options --machine, --simulate, --bus and --seed, for `load_machines`."""
    for option in (
        click.option("--seed", type=click.IntRange(0), default=1, show_default=True,
                     help="Seed of the simulated noise and friction scatter."),
        click.option("--bus", type=BusType(),
                     help="CAN bus, e.g. socketcan:can0.  [default: the machine file's]"),
        click.option("--simulate", type=FILE, is_flag=False, flag_value=_SAME_AS_HOST,
                     metavar="[TRUTH]", help="Run on virtual drives, in virtual time. TRUTH: "
                     "machine file of the simulated stage.  [default: the host's own]"),
        click.option("--machine", type=FILE,
                     help="Machine file: the host's model of the stage.  [default: wafer-xy]"),
    ):  # fmt: skip
        command = option(command)
    return command


def load_machines(
    machine: Path | None, simulate: Path | None, bus: tuple[str, str] | None, moves: bool = True
) -> tuple[Machine, Machine | None]:
    """The host's machine model and that of the simulated stage (None on a real stage).

    Args:
        machine: `--machine`.
        simulate: `--simulate`.
        bus: `--bus`.
        moves: whether the stage is to move; if so, warns that a virtual bus has no drives on it.

    Raises:
        click.UsageError: both `simulate` and `bus` are given.
        ConfigError: a machine file is unusable, or the two do not match.
    """
    if simulate is not None and bus is not None:
        raise click.UsageError(
            "--bus cannot be combined with --simulate, which has a bus of its own"
        )
    believed = _load(machine)
    if simulate is None:
        if moves and (bus[0] if bus else believed.bus.interface) == "virtual":
            click.echo("a virtual bus has no drives on it; --simulate adds them", err=True)
        return believed, None
    truth = believed if simulate == _SAME_AS_HOST else _load(simulate)
    _check_match(believed, truth)
    return believed, truth


def stop_on_signal(stop: Callable[[str], None]) -> None:
    """From now on, Ctrl-C, SIGTERM and a lost terminal request a controlled stop.

    A hang-up that was ignored at the start, as under nohup, stays ignored.
    """

    def handler(number: int, _: Any) -> None:
        name = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
        stop(f"stopped by the operator ({name})")

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _load(path: Path | None) -> Machine:
    from stagectl.config import load_machine

    packaged = path is None or (str(path) == _PACKAGED and not path.exists())
    return load_machine(None if packaged else path)


def _check_match(believed: Machine, truth: Machine) -> None:
    """Host and virtual drives need the same axes, node ids and SYNC period."""
    from stagectl.errors import ConfigError

    def require(key: str, there: object, here: object) -> None:
        if there != here:
            raise ConfigError(f"{truth.source}: {key}: {there}; the host's machine file has {here}")

    require("axes", ", ".join(truth.axes), ", ".join(believed.axes))
    for name, axis in truth.axes.items():
        require(f"axes.{name}.node", axis.node, believed.axes[name].node)
    require("bus.sync_period", f"{truth.bus.sync_period:g} s", f"{believed.bus.sync_period:g} s")
