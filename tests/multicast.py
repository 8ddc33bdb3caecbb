"""Tests over udp_multicast, where the machine has multicast (a container may have none).

Asked for with a bus of python-can's own, not one of ours: what ours does wrong is to be found, not
skipped. With STAGECTL_REQUIRE_MULTICAST=1, as in `.ci/run`, a machine without is a failure.
"""

from __future__ import annotations

import os

import can
import pytest

REQUIRED = "STAGECTL_REQUIRE_MULTICAST"


def require_multicast(group: str) -> None:
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
