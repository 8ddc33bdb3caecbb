"""pytest fixtures for testing your own code on a virtual stage, without hardware and fast.

    def test_my_move(virtual_stage):
        samples = virtual_stage.stream(position, offset)   # drivers.Stage, homed and enabled

The drives run on a lock-step CAN bus in virtual time: nothing waits, and every run produces the
same bytes. Override `stage_machine` (your machine file) or `stage_seed` in your `conftest.py`.
The pytest11 entry point loads this module in every pytest session, so everything but pytest is
imported by the fixture that needs it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    import can

    from drivers.stage import Stage
    from hil_sim.stage import VirtualStage
    from stagectl.config import Machine

_channels = itertools.count(1)


@pytest.fixture(scope="session")
def stage_machine() -> Machine:
    """The machine to simulate: the packaged `wafer-xy`. Override to use another."""
    from stagectl.config import load_machine

    return load_machine(None)


@pytest.fixture
def stage_seed() -> int:
    """Seed of encoder noise, repeatability and power-on positions: 1. Override or parametrise."""
    return 1


@pytest.fixture
def virtual_drives(stage_machine: Machine, stage_seed: int) -> VirtualStage:
    """Plant and drives on `stage_bus`, for access to their inner state (`.plant`, `.drives`)."""
    from hil_sim.stage import VirtualStage
    from stagectl.config import stage_settings

    return VirtualStage(stage_settings(stage_machine), stage_seed)


@pytest.fixture
def stage_bus(virtual_drives: VirtualStage) -> Iterator[can.BusABC]:
    """An open python-can bus in virtual time with the drives on it, for any CANopen master.

    `bus.clock.now_ns()` is the virtual time; it advances only while someone waits (`recv`,
    `clock.sleep_until_ns`).
    """
    from hil_sim.bus import LockstepBus, World

    world = World(f"pytest-{next(_channels)}")
    virtual_drives.attach(world)
    bus = LockstepBus(channel=world.name)
    yield bus
    bus.shutdown()


@pytest.fixture
def virtual_stage(stage_bus: can.BusABC, stage_machine: Machine) -> Iterator[Stage]:
    """`drivers.stage.Stage` on `stage_bus`: booted, homed, enabled; closed after the test."""
    from drivers.stage import Stage
    from stagectl.config import driver_settings

    bus, axes = driver_settings(stage_machine)
    with Stage.open(bus, axes, bus_object=stage_bus) as stage:
        stage.boot()
        stage.home()
        stage.enable()
        yield stage
