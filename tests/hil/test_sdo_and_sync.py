"""Host and virtual drive together: block uploads, SYNC with a counter."""

import numpy as np
import pytest

from drivers.errors import ConfigurationError
from tests.lockstep import open_on, power_up, switch_on


@pytest.fixture
def world(stage_machine):
    drives, world = switch_on(stage_machine)
    world.sleep_until_ns(50_000_000)
    return world, drives


def test_sync_with_a_counter(stage_machine, world):
    counters = []

    def tap(time_ns, can_id, data):
        if can_id == 0x80:
            counters.append(data[0])

    with open_on(world[0], stage_machine, tap, {"sync_counter": 10}) as stage:
        power_up(stage)
        assert stage.hold(0.05).valid.all()
    assert set(counters) == set(range(1, 11))
    assert set(np.diff(counters)) == {1, -9}
    # the next session wants none, and says so to the drives
    with open_on(world[0], stage_machine) as stage:
        stage.boot()
        stage.enable()
        assert stage.hold(0.01).valid.all()


def test_a_counter_that_a_drive_does_not_support_is_refused(stage_machine, world):
    del world[1].drives[0].dictionary.variables[0x101900]
    with (
        open_on(world[0], stage_machine, bus={"sync_counter": 10}) as stage,
        pytest.raises(ConfigurationError, match=r"^axis x: 0x1019:00 .*is not offered"),
    ):
        stage.boot()
