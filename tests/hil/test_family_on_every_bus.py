"""Drives that play a family, behind every bus: without csp, with SDO answers of four bytes."""

import pytest

from stagectl.config.machine.file import load_machine
from stagectl.config.profiles import with_profile

pytestmark = pytest.mark.every_bus


@pytest.fixture(scope="module")
def stage_machine():
    return with_profile(load_machine(), "simpliq")


def test_they_are_operated_by_their_own_profiles(rig):
    with rig.open() as stage:
        stage.boot()
        assert any("profile simpliq: fills modes" in line for line in stage.limitations)
        stage.reset_faults()
        stage.home()
        stage.enable()
        start = stage.positions
        for way in (2e-4, 0.0):
            goal = [at + way for at in start]
            samples = stage.stream_to(goal, (0.01, 0.01), (1.0, 1.0))
            held = stage.hold(0.2)
            assert samples.valid.any()
            for axis in range(2):
                reached = held.position[held.valid[:, axis], axis][-1]
                assert reached == pytest.approx(goal[axis], abs=rig.arrived_within(3e-6) + 3e-6)
        stage.disable()
