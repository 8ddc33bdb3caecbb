"""SYNC by the kernel's broadcast manager: independent of the host, with a counter, ended with it.

Runs where STAGECTL_HIL_SOCKETCAN names an interface (tests/system/test_vcan.py).
"""

import dataclasses
import time

import numpy as np
import pytest

from tests.hil.conftest import RIGS

ON_SOCKETCAN = [
    pytest.param(
        "socketcan",
        marks=[
            pytest.mark.real_time,
            pytest.mark.skipif("socketcan" not in RIGS, reason="run by test_vcan.py on a bus"),
        ],
    )
]


@pytest.fixture(scope="module", params=ON_SOCKETCAN)
def on_socketcan(request, stage_machine):
    yield from RIGS[request.param](stage_machine)


def syncs(other, count):
    """The next SYNCs."""
    seen = []
    while len(seen) < count:
        message = other.recv(30.0)
        assert message is not None, f"{len(seen)} SYNCs, then silence"
        if message.arbitration_id == 0x80:
            seen.append(message)
    return seen


def test_the_kernels_sync_goes_on_while_the_host_computes_and_ends_with_the_session(
    on_socketcan, travel_to
):
    bus = dataclasses.replace(on_socketcan.bus, sync_source="kernel", sync_counter=10)
    rig = dataclasses.replace(on_socketcan, bus=bus)
    with rig.other() as other:
        with rig.open() as stage:
            stage.boot()
            stage.reset_faults()
            stage.home()
            stage.enable()
            assert stage.notices == ()
            while other.recv(0) is not None:
                pass
            # nobody pumps here; the drives wait for 0.5 s
            seen = syncs(other, round(0.2 / rig.period))
            apart = (seen[-1].timestamp - seen[0].timestamp) / (len(seen) - 1)
            assert apart > 0.9 * rig.period  # a guest's timer may run slow
            counts = np.array([m.data[0] for m in seen])
            assert set(counts) == set(range(1, 11))
            assert set(np.diff(counts)) == {1, -9}
            target = [x + 1e-3 for x in stage.targets]
            samples = stage.stream(*travel_to(stage, target, 0.3, rig.period))
            assert samples.valid.mean() > 0.9
            # on the grid, and after a pause not counted as late
            places = np.diff(samples.time) / rig.period
            np.testing.assert_allclose(places, np.round(places), atol=1e-6)
        while other.recv(0) is not None:
            pass
        end = time.monotonic() + 0.3  # the drives' heartbeats go on
        while time.monotonic() < end:
            late = other.recv(0.1)
            assert late is None or late.arbitration_id != 0x80
