"""The console as a process: its socket, the server that it starts, the page's address."""

from __future__ import annotations

import os
import secrets
import signal
import socket
import webbrowser
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import uvicorn

from stagectl.console.access import Access, check_token
from stagectl.console.app import make_app
from stagectl.console.context import Context
from stagectl.console.gate import LARGEST, Addresses, is_loopback
from stagectl.console.jobs import Jobs
from stagectl.console.link import StageLink
from stagectl.console.recipes import Recipes
from stagectl.console.server_process import ServerProcess
from stagectl.errors import UnusableInput
from stagectl.protocol.endpoint import Endpoint

_PING = 10.0
"""Between two pings of a page; one that answers none within twice the time is gone [s]."""


@dataclass(frozen=True, slots=True)
class Listening:
    """Where the page is served.

    Attributes:
        host, port: address; port 0 for a free one.
        token_file: file of the token, or None for one of this process.
        origins: of proxies in front.
    """

    host: str
    port: int
    token_file: Path | None
    origins: tuple[str, ...]


def serve_console(
    at: Listening, where: Endpoint, server: ServerProcess | None, data: Path,
    recipes: Path | None, browser: bool,
) -> None:  # fmt: skip
    """Serve the page until a signal comes; the address is printed first.

    Args:
        at: address.
        where: sockets of the stage server.
        server: the process that the console has started it as, or None where one serves.
        data: folder of runs, while no server names one.
        recipes: folder of recipes, or None.
        browser: whether to open one.

    Raises:
        UnusableInput: address or token are unusable.
    """
    token = _token(at)
    with _listen(at.host, at.port) as listening, TemporaryDirectory(prefix="stagectl-") as own:
        port = listening.getsockname()[1]
        console = Context(
            Access(token), Addresses.of(at.host, port, at.origins), f"stagectl-{port}",
            StageLink(where), server, Recipes(recipes), Jobs(), data,
        )  # fmt: skip
        page = f"http://{f'[{at.host}]' if ':' in at.host else at.host}:{port}/"
        address = f"{page}#token={token}"
        click.echo(address if at.token_file is None else page)
        if browser:
            _open_browser(address, Path(own))
        _run(console, listening)
    if server is not None and server.is_running:
        _leave(server, console.link)


def _open_browser(address: str, folder: Path) -> None:
    """Open the page by a file of the user's: a browser's arguments can be read by all users."""
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return  # a browser in this terminal would be in the way
    page = folder / "console.html"
    page.write_text(f'<meta http-equiv="refresh" content="0;url={address}">', encoding="utf-8")
    webbrowser.open(page.as_uri())


def _run(console: Context, listening: socket.socket) -> None:
    signal.signal(signal.SIGTERM, lambda *_: None)  # uvicorn raises it again when it has ended
    with suppress(KeyboardInterrupt):
        uvicorn.Server(uvicorn.Config(make_app(console), **settings())).run([listening])


def settings() -> dict[str, Any]:
    """Of uvicorn: no trust in what proxies say, sizes and numbers limited, silent pages dropped."""
    return {
        "http": "h11", "ws": "websockets-sansio", "lifespan": "on", "log_config": None,
        "access_log": False, "proxy_headers": False, "server_header": False,
        "timeout_keep_alive": 20, "limit_concurrency": 200, "timeout_graceful_shutdown": 2,
        "h11_max_incomplete_event_size": 16384, "ws_max_size": LARGEST, "ws_max_queue": 32,
        "ws_ping_interval": _PING, "ws_ping_timeout": 2 * _PING,
    }  # fmt: skip


def _leave(server: ServerProcess, link: StageLink) -> None:
    """End the server that this console has started, unless a run is under way."""
    if link.last_run is not None:
        click.echo(
            f"the run of {link.last_run} goes on in the stage server, and so does that", err=True
        )
        return
    server.end()


def _token(at: Listening) -> str:
    if at.token_file is None:
        if not is_loopback(at.host):
            raise UnusableInput(
                f"--host {at.host}: another address than 127.0.0.1 needs --token-file"
            )
        return secrets.token_urlsafe(24)
    try:
        return check_token(at.token_file.read_text(encoding="utf-8"), str(at.token_file))
    except (OSError, UnicodeDecodeError) as why:
        raise UnusableInput(f"{at.token_file}: {why}") from why


def _listen(host: str, port: int) -> socket.socket:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, kind, protocol)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(128)
    except OSError as why:
        raise UnusableInput(f"{host}:{port}: {why.strerror or why}") from why
    return listening
