"""Options and machine files of the commands that move a stage or a simulation."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.options import FILE, BusType, option
from stagectl.errors import ConfigError

if TYPE_CHECKING:
    from stagectl.config import Machine

TWO_BUSES = "--bus cannot be combined with --simulate, which has a bus of its own"
_PACKAGED = "wafer-xy"
_SAME_AS_HOST = Path("same as the host")
"""`--simulate` without a value."""


class StageCommand(click.Command):
    """A command on a recipe with `StageOptions`, which says where its recipe has gone."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments; `--simulate recipe.yaml` takes the file as TRUTH and leaves no recipe."""
        given = list(args)
        try:
            return super().parse_args(ctx, args)
        except click.MissingParameter as missing:
            after = given[given.index("--simulate") + 1 :] if "--simulate" in given else []
            if not isinstance(missing.param, click.Argument) or not after or after[0][:1] == "-":
                raise
            name = missing.param.make_metavar(ctx)
            raise click.UsageError(
                f"no {name}: --simulate has taken {after[0]} as TRUTH; {name} comes before it: "
                f"'{ctx.command_path} {shlex.quote(after[0])} --simulate'",
                ctx,
            ) from missing


@dataclass(frozen=True)
class ServerOption:
    """The stage server to use."""

    server: str | None = option(
        "Stage server to use.  [default: the one that serves this machine file and bus, if any]",
        metavar="NAME",
    )


@dataclass(frozen=True)
class StageOptions:
    """The host's machine file, and the bus or the simulation that the stage is on."""

    machine: Path | None = option(
        "Machine file: the host's model of the stage.  [default: wafer-xy]", FILE
    )
    simulate: Path | None = option(
        "Run on virtual drives, in virtual time. TRUTH: machine file of the simulated stage.  "
        "[default: the host's own]",
        FILE,
        is_flag=False,
        flag_value=_SAME_AS_HOST,
        metavar="[TRUTH]",
    )
    bus: tuple[str, str] | None = option(
        "CAN bus, e.g. socketcan:can0.  [default: the machine file's]", BusType()
    )
    seed: int = option("Seed of the simulated noise and friction scatter.", click.IntRange(0), 1)

    def load(self, moves: bool = True) -> tuple[Machine, Machine | None]:
        """The host's machine model and that of the simulated stage (None on a real stage).

        Args:
            moves: whether the stage is to move, for which a bus is needed.

        Raises:
            click.UsageError: both --simulate and --bus are given, or neither is and the machine
                file's bus is virtual, which no drive is on.
            ConfigError: a machine file is unusable, or the two do not match.
        """
        if self.simulate is not None and self.bus is not None:
            raise click.UsageError(TWO_BUSES)
        believed = _load(self.machine)
        if self.simulate is None:
            if moves and self.bus is None and believed.bus.interface == "virtual":
                raise click.UsageError("no bus given: use --simulate, or --bus INTERFACE:CHANNEL")
            return believed, None
        truth = believed if self.simulate == _SAME_AS_HOST else _load(self.simulate)
        _check_match(believed, truth)
        return believed, truth


def warn_of_jitter(machine: Machine, bus: tuple[str, str] | None) -> None:
    """Before motion: whether this computer keeps the SYNC period, where it sends SYNC itself."""
    from stagectl.doctor import jitter_warning

    asked = machine.bus
    interface = asked.interface if bus is None else bus[0]
    by_kernel = interface == "socketcan" and asked.sync != "host"
    if not by_kernel and interface != "lockstep":
        warning = jitter_warning(asked.sync_period, replace(asked.realtime, freeze_gc=False))
        if warning is not None:
            click.echo(warning, err=True)


def _load(path: Path | None) -> Machine:
    from stagectl.config import load_machine

    packaged = path is None or (str(path) == _PACKAGED and not path.exists())
    return load_machine(None if packaged else path)


def _check_match(believed: Machine, truth: Machine) -> None:
    """Host and virtual drives need the same axes, node ids and SYNC period."""

    def require(key: str, there: object, here: object) -> None:
        if there != here:
            raise ConfigError(f"{truth.source}: {key}: {there}; the host's machine file has {here}")

    require("axes", ", ".join(truth.axes), ", ".join(believed.axes))
    for name, axis in truth.axes.items():
        require(f"axes.{name}.node", axis.node, believed.axes[name].node)
    require("bus.sync_period", f"{truth.bus.sync_period:g} s", f"{believed.bus.sync_period:g} s")
