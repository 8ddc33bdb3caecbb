"""Where a stage server and its clients meet: two sockets in a folder of the user's.

The folder is `$XDG_RUNTIME_DIR/stagectl`, or `/run/stagectl-UID`, or `/tmp/stagectl-UID` where the
first two cannot be; `STAGECTL_RUNTIME` names another one, as for operators of a service user's
server. A server is named after the bus it owns, a simulated one `simulated` or as it was called.
"""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from stagectl.errors import StagectlError, UnusableInput

VARIABLE = "STAGECTL_RUNTIME"
SIMULATED = "simulated"
_LONGEST = 100
"""Bytes of a path of a UNIX socket, with some to spare (sun_path has 108)."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """The two sockets of a server.

    Attributes:
        folder: they are in.
        name: of the server.
    """

    folder: Path
    name: str

    @property
    def commands(self) -> Path:
        """Path of the ROUTER socket."""
        return self.folder / f"{self.name}.commands"

    @property
    def events(self) -> Path:
        """Path of the PUB socket."""
        return self.folder / f"{self.name}.events"

    @property
    def lock(self) -> Path:
        """Path of the file that a server keeps locked."""
        return self.folder / f"{self.name}.lock"

    @staticmethod
    def url(path: Path) -> str:
        """Of a socket, for 0MQ."""
        return f"ipc://{path}"


def runtime_folder() -> Path:
    """The folder of the sockets, which need not exist."""
    if given := os.environ.get(VARIABLE):
        return Path(given)
    if runtime := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(runtime) / "stagectl"
    name = f"stagectl-{os.getuid()}"
    own = Path("/run") / name
    return own if own.is_dir() or os.access("/run", os.W_OK) else Path("/tmp") / name  # noqa: S108


def endpoint(name: str) -> Endpoint:
    """The endpoint of a server of this name.

    Raises:
        UnusableInput: the name, or the path with it, cannot be a socket's.
    """
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
        raise UnusableInput(f"server {name!r}: letters, digits, '.', '_' and '-' only")
    made = Endpoint(runtime_folder(), name)
    if len(os.fsencode(made.commands)) > _LONGEST:
        raise UnusableInput(f"{made.commands}: too long for a socket; set {VARIABLE}")
    return made


def name_of_bus(interface: str, channel: str) -> str:
    """The name of the server that owns a bus."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", f"{interface}-{channel}").strip(".-_")[:64] or "bus"


def make_folder(folder: Path, group: int | None) -> None:
    """Make the folder of the sockets, for its user alone or for a group as well.

    Args:
        folder: to make, or there already.
        group: its number, or None.

    Raises:
        StagectlError: it cannot be made, belongs to another user, or others can write to it.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if group is not None:
            os.chown(folder, -1, group)
            folder.chmod(0o750)
        found = folder.stat(follow_symlinks=False)
    except OSError as why:
        raise StagectlError(f"{folder}: {why.strerror}") from why
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise StagectlError(f"{folder}: is not a folder of this user")
    if found.st_mode & (0o022 if group is not None else 0o077):
        raise StagectlError(f"{folder}: others can write to it or read it (mode must be 0700)")
