"""`stagectl serve`: own a stage and serve clients."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from stagectl.cli.file_kinds import ANY
from stagectl.cli.files import Output, OutputFolder
from stagectl.cli.options import NumberRange, option, takes
from stagectl.cli.signals import on_stop
from stagectl.cli.stage_options import StageOptions, warn_of_jitter
from stagectl.errors import UnusableInput


@dataclass(frozen=True)
class _ServerOptions:
    """Where it serves, and for how long it holds."""

    data: Path = option("Folder for the queue and for runs.", OutputFolder(), Path("runs"))
    name: str | None = option("Name of the server.  [default: its bus; simulated]")
    group: str | None = option("Let the members of this group in as well.", metavar="GROUP")
    hold: float = option(
        "Disable axes that are held while nothing is asked for after this time [s].",
        NumberRange(1.0, 86400.0),
        600.0,
    )
    metrics: int | None = option(
        "Serve figures for Prometheus on this port of this computer.",
        click.IntRange(1, 65535),
        metavar="PORT",
    )
    pace_statistics: Path | None = option(
        "Write at the end how well the virtual drives kept to the clock (.npz).",
        Output(ANY),
        hidden=True,
    )
    pause: float = option(
        "End a run that is paused for longer than this [s].", NumberRange(1.0, 86400.0), 600.0
    )


@click.command
@takes(StageOptions)
@takes(_ServerOptions)
def command(stage: StageOptions, server: _ServerOptions) -> None:
    """Own the stage, and let clients run recipes, move, watch and stop it.

    \b
    On a virtual stage, paced by the wall clock:
      stagectl serve --simulate
    On a real stage:
      stagectl serve --machine M.yaml --bus socketcan:can0

    Axes are homed once and held between commands. `run`, `home`, `jog` and `enable` use the server
    of their machine file and bus by themselves; a simulated one is reached with --server, by
    `stagectl console` and by scripts (stagectl.client). The queue of recipes is on disk: after a
    crash it is there again, and nothing starts by itself.

    Ctrl-C ends it: a run is stopped, the axes are disabled. If it is killed, the drives miss its
    heartbeat and stop by themselves.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from stagectl.config import driver_settings
    from stagectl.protocol.endpoint import SIMULATED, endpoint, name_of_bus
    from stagectl.server.keeper import Simulated
    from stagectl.server.serving import serve
    from stagectl.server.setup import Setup

    believed, truth = stage.load()
    bus, axes = driver_settings(believed, stage.bus)
    simulated = None if truth is None else Simulated(truth, stage.seed)
    own = SIMULATED if simulated is not None else name_of_bus(bus.interface, bus.channel)
    setup = Setup(
        believed, stage.machine, bus, axes, stage.bus, simulated, server.data, server.hold,
        server.pause, server.pace_statistics,
    )  # fmt: skip
    if simulated is None:
        warn_of_jitter(believed, stage.bus)
    serve(
        setup,
        endpoint(server.name or own),
        _group(server.group),
        lambda text: click.echo(text),
        _stop_on_signal,
        server.metrics,
    )


def _group(name: str | None) -> int | None:
    import grp

    if name is None:
        return None
    try:
        return grp.getgrnam(name).gr_gid
    except KeyError:
        raise UnusableInput(f"--group: there is no group {name!r}") from None


def _stop_on_signal(end: Callable[[], None]) -> None:
    def handler(_: int, __: Any) -> None:
        end()

    on_stop(handler)
    signal.signal(signal.SIGTERM, handler)
