"""pytest fixtures for testing your own code on a virtual stage, without hardware and fast.

    def test_my_move(virtual_stage):
        samples = virtual_stage.stream(position, offset)   # drivers.Stage, homed and enabled

The drives run on a lock-step CAN bus in virtual time: nothing waits, and every run produces the
same bytes. `served_drives` is the exception, for masters with threads of their own. Override
`stage_machine` (your machine file) or `stage_seed` in your `conftest.py`.
The pytest11 entry point loads this module in every pytest session, so everything but pytest is
imported by the fixture that needs it.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
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


@pytest.fixture(scope="session")
def stage_seed() -> int:
    """Seed of encoder noise, repeatability and power-on positions: 1. Override or parametrise."""
    return 1


@pytest.fixture
def virtual_drives(stage_machine: Machine, stage_seed: int) -> VirtualStage:
    """Plant and drives on `stage_bus`, for access to their inner state (`.plant`, `.drives`)."""
    return _drives(stage_machine, stage_seed)


@pytest.fixture
def stage_bus(virtual_drives: VirtualStage) -> Iterator[can.BusABC]:
    """An open python-can bus in virtual time with the drives on it, for any CANopen master.

    `bus.clock.now_ns()` is the virtual time; it advances only while someone waits (`recv`,
    `clock.sleep_until_ns`). The drives send their boot-up messages 20 ms after the bus opens.
    """
    with _powered(virtual_drives) as bus:
        yield bus


@pytest.fixture
def virtual_stage(stage_bus: can.BusABC, stage_machine: Machine) -> Iterator[Stage]:
    """`drivers.stage.Stage` on `stage_bus`: booted, homed, enabled; closed after the test."""
    with _enabled(stage_bus, stage_machine) as stage:
        yield stage


@pytest.fixture(scope="module")
def module_stage(stage_machine: Machine, stage_seed: int) -> Iterator[Stage]:
    """As `virtual_stage`, homed once for a module: each test continues where the last one ended."""
    with _powered(_drives(stage_machine, stage_seed)) as bus, _enabled(bus, stage_machine) as stage:
        yield stage


@pytest.fixture
def served_drives(stage_machine: Machine, stage_seed: int) -> Iterator[dict[str, str]]:
    """A bus in real time with the drives on it, for masters that read it in a thread of their own.

    The value holds the arguments of `can.Bus`, or of `canopen.Network().connect`; any number of
    buses may be opened. A thread serves the drives on the wall clock until the test ends. They have
    sent their boot-up messages before the test begins.
    """
    import can

    from hil_sim.bus import serve
    from hil_sim.plant import warm_up
    from stagectl.config import stage_settings

    warm_up(stage_settings(stage_machine))  # compiles now, not when a master waits for an answer
    drives = _drives(stage_machine, stage_seed)
    stop, where = (
        threading.Event(),
        {"interface": "virtual", "channel": f"pytest-{next(_channels)}"},
    )
    with can.Bus(**where) as theirs, can.Bus(**where) as ours:  # type: ignore[arg-type]
        thread = threading.Thread(target=serve, args=(drives, theirs, stop), daemon=True)
        thread.start()
        for _ in stage_machine.axes:
            ours.recv()
        yield where
        stop.set()
        thread.join()


def _drives(machine: Machine, seed: int) -> VirtualStage:
    from hil_sim.stage import VirtualStage
    from stagectl.config import stage_settings

    return VirtualStage(stage_settings(machine), seed)


@contextmanager
def _powered(drives: VirtualStage) -> Iterator[can.BusABC]:
    """A bus in virtual time, on which the drives have just been switched on."""
    from hil_sim.bus import LockstepBus, World

    world = World(f"pytest-{next(_channels)}")
    drives.attach(world)
    bus = LockstepBus(channel=world.name)
    yield bus
    bus.shutdown()


@contextmanager
def _enabled(bus: can.BusABC, machine: Machine) -> Iterator[Stage]:
    from drivers.stage import Stage
    from stagectl.config import driver_settings

    settings, axes = driver_settings(machine)
    with Stage.open(settings, axes, bus_object=bus) as stage:
        stage.boot()
        stage.home()
        stage.enable()
        yield stage
