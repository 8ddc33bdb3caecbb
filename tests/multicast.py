"""Tests over udp_multicast, where the machine has multicast (a container may have none).

Asked for with a bus of python-can's own, not one of ours: what ours does wrong is to be found, not
skipped. With STAGECTL_REQUIRE_MULTICAST=1, as in `.ci/run`, a machine without is a failure.
"""

import json
import os
import socket

import can
import pytest

REQUIRED = "STAGECTL_REQUIRE_MULTICAST"


def require_multicast(group):
    """Skips, or fails, where a frame sent to this group does not come back."""
    try:
        with can.Bus(interface="udp_multicast", channel=group) as bus:
            bus.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
            problem = "" if bus.recv(1.0) is not None else "nothing comes back"  # it hears itself
    except (can.CanError, OSError) as why:
        problem = str(why)
    if problem and os.environ.get(REQUIRED):
        pytest.fail(f"no multicast on this machine: {problem}, and {REQUIRED} is set")
    if problem:
        pytest.skip(f"udp_multicast NOT TESTED: no multicast on this machine: {problem}")


def require_multicast_on_own_port(group, patch):
    """The same on a port of our own, for this environment: every group is heard on a port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        patch.setenv("CAN_CONFIG", json.dumps({"port": probe.getsockname()[1]}))
    require_multicast(group)
