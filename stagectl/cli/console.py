"""`stagectl console`: the web page that an operator sits at."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import click

from stagectl.cli.files import InputFolder
from stagectl.cli.options import FILE, BusType, option, takes
from stagectl.cli.stage_options import TWO_BUSES
from stagectl.errors import UnusableInput, missing_extra

_NEEDED = ("starlette", "uvicorn", "websockets")
_SAME_AS_HOST = Path("same as the host")
_RUNS = Path("runs")
_RECIPES = Path("recipes")


@dataclass(frozen=True)
class _Stage:
    """Which stage server; how one is started where none serves."""

    server: str | None = option(
        "Name of the stage server.  [default: the only one]", metavar="NAME"
    )
    machine: Path | None = option("Machine file of a server to be started.", FILE)
    simulate: Path | None = option(
        "Start a server on virtual drives, unless one runs. TRUTH: machine file of the simulated "
        "stage.  [default: the host's own]",
        FILE,
        is_flag=False,
        flag_value=_SAME_AS_HOST,
        metavar="[TRUTH]",
    )
    bus: tuple[str, str] | None = option("CAN bus of a server to be started.", BusType())
    data: Path | None = option(
        "Folder of runs.  [default: the server's]", InputFolder(), metavar="FOLDER"
    )
    recipes: Path | None = option(
        "Folder of recipes to choose from.  [default: recipes, if there is one]",
        InputFolder(exists=True),
        metavar="FOLDER",
    )

    def serve_arguments(self, name: str) -> list[str]:
        """Of `stagectl serve`."""
        given: list[str] = ["--name", name]
        if self.machine is not None:
            given += ["--machine", str(self.machine)]
        if self.simulate is not None:
            given += ["--simulate"]
            given += [] if self.simulate == _SAME_AS_HOST else [str(self.simulate)]
        if self.bus is not None:
            given += ["--bus", ":".join(self.bus)]
        if self.data is not None:
            given += ["--data", str(self.data)]
        return given


@dataclass(frozen=True)
class _Page:
    """How the page is served."""

    port: int = option("Port of the page; 0: a free one.", click.IntRange(0, 65535), 8402)
    host: str = option(
        "Address to listen on; one of the network needs --token-file.", default="127.0.0.1"
    )
    token_file: Path | None = option(
        "File of the token that opens the page.  [default: a new one for each start]", FILE
    )
    origin: tuple[str, ...] = option(
        "Address of a TLS proxy or tunnel under which the page is reached, such as "
        "https://stage.example; repeatable.",
        multiple=True, default=(), metavar="URL",
    )  # fmt: skip
    browser: bool = option(
        "Open the page in a browser.", default=True, flags="--browser/--no-browser"
    )


@click.command()
@takes(_Stage)
@takes(_Page)
def command(stage: _Stage, page: _Page) -> None:
    """Serve the operator's page: watch and move the stage, run recipes, look at what they gave.

    \b
    On the virtual stage:
      stagectl console --simulate
    For the stage server that runs:
      stagectl console

    The address on the first line holds the token that opens the page. Where no stage server serves,
    --simulate or --bus starts one, as 'stagectl serve' does; it goes on without the console while a
    run is under way. Stop on the page is no emergency stop.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    if missing := [name for name in _NEEDED if find_spec(name) is None]:
        raise missing_extra("the console needs", ", ".join(missing), "console")
    from stagectl.client import server_names
    from stagectl.console.server_process import ServerProcess
    from stagectl.protocol.endpoint import endpoint

    running = server_names()
    name = _server_name(stage, running)
    where = endpoint(name)
    server = None if name in running else ServerProcess(where, stage.serve_arguments(name))
    if server is not None:
        server.start()  # it takes longer to import than the console
    from stagectl.console.process import Listening, serve_console

    try:
        serve_console(
            Listening(page.host, page.port, page.token_file, page.origin), where, server,
            (stage.data or _RUNS).absolute(),
            stage.recipes or (_RECIPES if _RECIPES.is_dir() else None), page.browser,
        )  # fmt: skip
    except BaseException:
        if server is not None:
            server.end()
        raise


def _server_name(stage: _Stage, running: list[str]) -> str:
    """The server to watch, or to start.

    Raises:
        click.UsageError: options contradict each other.
        UnusableInput: there is none, or there are several.
    """
    from stagectl.protocol.endpoint import SIMULATED, name_of_bus

    if stage.simulate is not None and stage.bus is not None:
        raise click.UsageError(TWO_BUSES)
    if stage.simulate is not None:
        return stage.server or SIMULATED
    if stage.bus is not None:
        return stage.server or name_of_bus(*stage.bus)
    if stage.server is not None:
        if stage.server not in running:
            raise UnusableInput(f"no stage server {stage.server!r} runs; start one: stagectl serve")
        return stage.server
    if len(running) != 1:
        several = f"several stage servers run: {', '.join(running)}; name one with --server"
        none = "no stage server runs: start one with --simulate or --bus INTERFACE:CHANNEL"
        raise UnusableInput(several if running else none)
    return running[0]
