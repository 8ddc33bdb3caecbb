"""Which servers there are."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from stagectl.client.base import NoServer
from stagectl.protocol.endpoint import Endpoint, endpoint, name_of_bus, runtime_folder


def server_names() -> list[str]:
    """Names of the servers that run, of this user or of one that lets this user in."""
    try:
        found = sorted(path for path in runtime_folder().iterdir() if path.suffix == ".lock")
    except OSError:
        return []
    return [path.stem for path in found if _is_locked(path)]


def find_server(interface: str, channel: str) -> Endpoint | None:
    """The server that owns a bus, or None."""
    name = name_of_bus(interface, channel)
    return endpoint(name) if name in server_names() else None


def locate(server: str | Endpoint | None) -> Endpoint:
    """The endpoint of a server.

    Args:
        server: its name; its endpoint; or None for the only one there is.

    Raises:
        NoServer: it does not run, or None is given where there are several.
    """
    if isinstance(server, Endpoint):
        return server
    names = server_names()
    if server is None:
        if len(names) != 1:
            raise NoServer(
                f"no stage server runs (looked in {runtime_folder()}); start one: stagectl serve"
                if not names
                else f"several stage servers run: {', '.join(names)}; name one"
            )
        return endpoint(names[0])
    if server not in names:
        others = f"; there are: {', '.join(names)}" if names else ""
        raise NoServer(f"no stage server {server!r} runs in {runtime_folder()}{others}")
    return endpoint(server)


def _is_locked(path: Path) -> bool:
    """Whether a running server holds a lock file; one that was killed holds none."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(file)
    return False
