"""SocketCAN from the kernel that is running: four ways, the least intrusive first.

1. The environment names an interface that is up: that one.
2. A network namespace of the command's own with a vcan0 in it. It ends with the command, and no
   other run sees its frames. Without root this takes a user namespace.
3. A vcan interface that is up already; one run at a time.
4. As root, where namespaces are forbidden: make vcan0 (it stays), then as 3.

The command replaces this process, so that terminal, signals and exit status are its own.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vcan_bus.errors import NoBusError

VARIABLE = "STAGECTL_HIL_SOCKETCAN"
IFF_UP = 1
ARPHRD_CAN = 280

# lo with multicast, so that python-can's udp_multicast works beside vcan0
SET_UP = """
PATH=$PATH:/usr/sbin:/sbin
ip link add dev vcan0 type vcan && ip link set vcan0 up || exit 125
ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo
"""


@dataclass(frozen=True)
class Way:
    """How a command gets a bus.

    Attributes:
        name: for people.  interface: for the command.
        prefix: what the command is put behind.  exclusive: whether runs must take turns.
    """

    name: str
    interface: str
    prefix: Sequence[str] = field(default=())
    exclusive: bool = False

    def run(self, command: Sequence[str], time_limit: float | None) -> int:
        """Becomes the command.

        Returns:
            127 or 126, if the command cannot be started; otherwise it doesn't return.
        """
        if self.exclusive:
            _take_turns(self.interface)
        os.environ[VARIABLE] = self.interface
        limit = ["timeout", "--kill-after=5", str(time_limit)] if time_limit is not None else []
        arguments = [*self.prefix, *limit, *command]
        try:
            os.execvp(arguments[0], arguments)  # noqa: S606
        except OSError as why:
            sys.stderr.write(f"with-vcan: {arguments[0]}: {why.strerror}\n")
            return 127 if isinstance(why, FileNotFoundError) else 126


def find() -> Way | None:
    """The first way that this kernel and the caller's rights allow.

    Raises:
        NoBusError: the environment names an interface that is not there or not up.
    """
    named = os.environ.get(VARIABLE)
    if named:
        if not _is_up(named):
            raise NoBusError(f"{VARIABLE}={named}: no such CAN interface, or it is not up")
        return Way(f"interface {named}, named in {VARIABLE}", named)
    prefix = _namespace()
    if _works([*prefix, "true"]):
        return Way("a network namespace with a vcan0 of its own", "vcan0", prefix)
    up = _vcan_interfaces()
    if not up and os.geteuid() == 0:
        _works(["sh", "-c", "ip link add dev vcan0 type vcan && ip link set vcan0 up"])
        up = _vcan_interfaces()
    return Way(f"interface {up[0]}", up[0], exclusive=True) if up else None


def _namespace() -> list[str]:
    """A command line in front of a command: own network, vcan0 up, no more rights than before."""
    inside = SET_UP + 'exec "$@"'
    if os.geteuid() == 0:
        return ["unshare", "--net", "sh", "-c", inside, "sh"]
    give_up_rights = ["setpriv", "--inh-caps=-all", "--ambient-caps=-all"]
    own_user = ["--user", "--map-current-user", "--keep-caps"]
    return ["unshare", *own_user, "--net", "sh", "-c", inside, "sh", *give_up_rights]


def _works(command: Sequence[str]) -> bool:
    if shutil.which(command[0]) is None:
        return False
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, timeout=20, check=False
    )
    return done.returncode == 0


def _is_up(interface: str) -> bool:
    folder = Path("/sys/class/net") / interface
    try:
        flags = int((folder / "flags").read_text(), 16)
        kind = int((folder / "type").read_text())
    except (OSError, ValueError):
        return False
    return bool(flags & IFF_UP) and kind == ARPHRD_CAN


def _vcan_interfaces() -> list[str]:
    """CAN interfaces that are up and have no device behind them."""
    network = Path("/sys/class/net")
    if not network.is_dir():
        return []
    return sorted(
        entry.name
        for entry in network.iterdir()
        if _is_up(entry.name) and not (entry / "device").exists()
    )


def _take_turns(interface: str) -> None:
    """Waits for other runs; the lock is held until the command and its children have ended.

    An abstract socket lives in the same network namespace as the interface, and leaves no file.
    """
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    waiting = False
    while True:
        try:
            lock.bind(f"\0stagectl-with-vcan-{interface}")
            break
        except OSError:
            if not waiting:
                sys.stderr.write(f"with-vcan: {interface} is in use by another run; waiting\n")
                waiting = True
            time.sleep(0.2)
    os.set_inheritable(lock.detach(), True)
