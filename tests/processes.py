"""`stagectl` as processes of their own, as users start them, on buses in real time."""

import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

from stagectl.config import load_machine
from tests.multicast import require_multicast_on_own_port
from tests.signals import listening

INTERFACE = os.environ.get("STAGECTL_HIL_SOCKETCAN")


def start(
    *arguments, cwd=None, stdin=None, stdout=subprocess.PIPE, stderr=subprocess.PIPE
):  # fmt: skip
    """Start the command; signals reach it as they reach one in a terminal."""
    path = os.pathsep.join(
        filter(None, [os.environ.get("PYTHONPATH"), str(Path(__file__).parents[1])])
    )
    return subprocess.Popen(
        [sys.executable, "-m", "stagectl", *map(str, arguments)],
        cwd=cwd, env=os.environ | {"PYTHONPATH": path}, text=True, stdin=stdin, stdout=stdout,
        stderr=stderr,
        preexec_fn=listening,
    )  # fmt: skip


@contextmanager
def drives_on(bus, machine):
    """`stagectl sim` with this machine file on a bus; at the end it is stopped."""
    with start("sim", "--machine", machine, "--bus", bus, stderr=subprocess.STDOUT) as drives:
        try:
            assert "node 1" in drives.stdout.readline()
            yield drives
        finally:
            drives.send_signal(signal.SIGINT)
            drives.communicate(timeout=60)
    assert drives.returncode == 0


def buses(group):
    """Parameters: this multicast group, and socketcan where there is an interface."""
    elsewhere = pytest.mark.skipif(not INTERFACE, reason="run by test_vcan.py on a bus of its own")
    return [
        pytest.param(f"udp_multicast:{group}", id="udp_multicast"),
        pytest.param(f"socketcan:{INTERFACE}", id="socketcan", marks=elsewhere),
    ]


def slow_machine(folder, bus, patch):
    """The packaged machine with a SYNC that no real-time computer is needed for, as a file."""
    machine = yaml.safe_load(load_machine().text)
    machine["bus"] |= {"sync_period": 0.01, "max_missed": 20}
    for axis in machine["axes"].values():
        axis["homing"] = {"method": 37}  # where it stands
    interface, channel = bus.split(":")
    if interface == "udp_multicast":
        require_multicast_on_own_port(channel, patch)
        machine["bus"]["realtime"] = {"priority": 50}
    path = folder / "slow.yaml"
    path.write_text(yaml.safe_dump(machine))
    return path
