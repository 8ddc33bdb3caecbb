"""pytest fixtures to test your own code on the virtual stage, without hardware and in no time.

    def test_my_move(virtual_stage):
        samples = virtual_stage.stream(position, offset)   # drivers.Stage, homed and enabled

The drives answer on a lock-step CAN bus in virtual time: nothing waits, every run gives the same
bytes. Override `stage_machine` (a machine file of yours) or `stage_seed` in your `conftest.py`.
Registered as a pytest11 entry point, so it costs an import of pytest only; everything else is
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
    from stagectl.config.machine import Machine

_channels = itertools.count(1)


@pytest.fixture(scope="session")
def stage_machine() -> Machine:
    """The machine that the virtual stage is: the packaged `wafer-xy`. Override to use another."""
    from stagectl.config.machine_file import load_machine

    return load_machine(None)


@pytest.fixture
def stage_seed() -> int:
    """Seed of encoder noise, repeatability and power-on positions: 1. Override or parametrise."""
    return 1


@pytest.fixture
def virtual_drives(stage_machine: Machine, stage_seed: int) -> VirtualStage:
    """Plant and drives behind `stage_bus`, for a look behind the curtain (`.plant`, `.drives`)."""
    from hil_sim.stage import VirtualStage
    from stagectl.config.mapping import stage_settings

    return VirtualStage(stage_settings(stage_machine), stage_seed)


@pytest.fixture
def stage_bus(virtual_drives: VirtualStage) -> Iterator[can.BusABC]:
    """An open python-can bus in virtual time with the drives on it, for any CANopen master.

    `bus.clock.now_ns()` is its time; only waiting (`recv`, `clock.sleep_until_ns`) moves it.
    """
    from hil_sim.bus import LockstepBus, World

    world = World(f"pytest-{next(_channels)}")
    virtual_drives.attach(world)
    bus = LockstepBus(channel=world.name)
    yield bus
    bus.shutdown()


@pytest.fixture
def virtual_stage(stage_bus: can.BusABC, stage_machine: Machine) -> Iterator[Stage]:
    """`drivers.Stage` on that bus: booted, homed, enabled, ready to stream; closed afterwards."""
    from drivers.stage import Stage
    from stagectl.config.mapping import driver_settings

    bus, axes = driver_settings(stage_machine)
    with Stage.open(bus, axes, bus_object=stage_bus) as stage:
        stage.boot()
        stage.home()
        stage.enable()
        yield stage
