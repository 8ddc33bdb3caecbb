"""`stagectl sim`: a virtual stage in real time on a CAN bus, for any CANopen master."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import FILE, BusType
from stagectl.cli.signals import on_stop
from stagectl.errors import unusable

if TYPE_CHECKING:
    import can

    from stagectl.config import Machine


def _list_families(context: click.Context, _: click.Parameter, family: str | None) -> str | None:
    """Lists the families instead, where that is asked for."""
    if family != "?":
        return family
    from stagectl.cli.terminal import console_for, make_table
    from stagectl.config.profiles import families, load_profile

    rows = [(name, load_profile(name).drives) for name in families()]
    console_for(None).print(make_table("drive profiles", ("family", "drives"), rows))
    context.exit()


@click.command
@click.option(
    "--machine", type=FILE, help="Machine file of the stage to simulate.  [default: wafer-xy]"
)
@click.option("--bus", type=BusType(), help="Any python-can bus.  [default: the machine file's]")
@click.option("--as", "family", metavar="FAMILY", callback=_list_families,
              help="Play drives of this family, by its profile; ? lists them.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=1,
              help="Seed of noise, friction scatter and start position.")  # fmt: skip
def command(
    machine: Path | None, bus: tuple[str, str] | None, family: str | None, seed: int
) -> None:
    """Simulate one CiA 402 drive per axis and the mechanics behind them, until Ctrl-C.

    \b
    Between processes on one machine, without CAN hardware:
      stagectl sim --bus udp_multicast:239.74.163.2
      stagectl run RECIPE.yaml --bus udp_multicast:239.74.163.2
    On SocketCAN:
      stagectl sim --bus socketcan:vcan0

    The drives boot at once: boot-up message, then heartbeat. The command prints the path of their
    EDS file. If the bus goes away, they wait for it to return.

    With --as, they differ from CiA 301 and 402 as drives of that family are known to; the host's
    machine file then names the family as each drive's `profile`.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from drivers.canopen import open_bus
    from drivers.cyclic import RealTime
    from drivers.errors import BusOpenError
    from hil_sim.bus import serve
    from hil_sim.plant import warm_up
    from hil_sim.stage import VirtualStage
    from stagectl.config import driver_settings, stage_settings

    stage = _stage(machine, family)
    settings = stage_settings(stage)
    where, _ = driver_settings(stage, bus)
    with unusable(BusOpenError):
        opened = open_bus(where)

    def reopen() -> can.BusABC | None:
        with suppress(BusOpenError):
            return open_bus(where)
        return None

    def report(line: str) -> None:
        click.echo(f"bus {where}: {line}", err=True)

    # what the machine file asks for the host, except the core: on one core both would block
    real_time = RealTime(replace(where.realtime, core=None))
    stop = threading.Event()

    def handler(number: int, frame: Any) -> None:
        stop.set()

    on_stop(handler)
    warm_up(settings)
    virtual = VirtualStage(settings, seed)
    _announce(stage, str(where), family)
    real_time.begin()
    for refused in real_time.refused:
        click.echo(refused, err=True)
    try:
        segment = serve(virtual, opened, stop, reopen, report)
    finally:
        real_time.end()
    if segment.refused:
        click.echo(f"the bus refused {segment.refused} frames", err=True)


def _stage(file: Path | None, family: str | None) -> Machine:
    """The machine to simulate, with drives of a family if one is named.

    Raises:
        ConfigError: the file cannot be used, or there is no such family.
    """
    from stagectl.config import load_machine
    from stagectl.config.profiles import load_profile, with_profile

    machine = load_machine(file)
    if family is None:
        return machine
    return with_profile(machine, load_profile(family).family)


def _announce(stage: Machine, where: str, family: str | None) -> None:
    from stagectl.config import eds_path
    from stagectl.config.profiles import load_profile

    nodes = ", ".join(f"{name} = node {axis.node}" for name, axis in stage.axes.items())
    first, axis = next(iter(stage.axes.items()))
    click.echo(f"{stage.name} on {where}: {nodes}; stop with Ctrl-C")
    click.echo(f"EDS: {eds_path(stage, first, axis)}")
    if family is not None:
        click.echo(f"drives: {load_profile(family).drives}; in the host's file: profile: {family}")
