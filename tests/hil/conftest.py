"""The virtual stage behind every bus that the driver has to work on: one suite, several rigs.

lockstep lives in virtual time; virtual has the drives in a thread, udp_multicast and socketcan in
a process, both in real time. Real-time rigs run SYNC at 4 ms (10 ms where the kernel itself is a
process, with one CPU) and ask for SCHED_FIFO, which they get where that is permitted. A machine may
still be away for longer than a period: what a test says of single samples it says of those that the
cycle ledger calls undisturbed, and a test that fails while the machine is away is run again
(tests/conftest.py). Where an axis ends is held to the machine's position window there, for the way
of the demand is not the planned one when SYNCs are late; to nanometres in lockstep. socketcan runs
where the environment names an interface that is up, STAGECTL_HIL_SOCKETCAN=vcan0;
tests/system/test_vcan.py sees to it that there is one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import subprocess
import sys
import threading
import uuid
from dataclasses import dataclass
from pathlib import Path

import can
import numpy as np
import pytest

from drivers.cyclic import RealTime
from drivers.settings import AxisSettings, BusSettings, RealTimeSettings
from drivers.stage import Stage
from stagectl.config.settings.package_settings import driver_settings, stage_settings
from tests.lockstep import switch_on
from tests.multicast import require_multicast_on_own_port

START = (-5e-4, -4e-4)
MULTICAST_GROUP = "239.74.163.2"
PRESENT_POSITION = 37
"""Homing method that takes no time."""
REAL_TIME_PERIOD = 4e-3
PRIORITY = 50
GUEST_PERIOD = 10e-3
GUEST_MAX_MISSED = 20
"""A guest waits for its one processor as a whole, its drives and its host together."""


@dataclass(frozen=True)
class Rig:
    """A bus with the drives switched on.

    Attributes:
        bus: how to open it.  axes: the driver's settings.
        virtual_time: whether nothing can be late or lost.
    """

    bus: BusSettings
    axes: tuple[AxisSettings, ...]
    virtual_time: bool

    @property
    def guest(self):
        """Whether host and drives share the one processor of a guest, which waits for its own."""
        return self.bus.sync_period == GUEST_PERIOD

    @property
    def period(self):
        """Ts [s]."""
        return self.bus.sync_period

    def arrived_within(self, lockstep):
        """How near an axis at rest is to its setpoint [m], `lockstep` where no SYNC is late.

        In real time it is the position window (0x6067), within which the drive itself calls a
        target reached: a demand that stands still for some SYNCs and then catches up is another
        motion, and friction leaves the axis elsewhere for a while.
        """
        return lockstep if self.virtual_time else min(a.position_window for a in self.axes)

    def undisturbed(self, samples):
        """bool[K]: the SYNC went out in time, one period after the one before, and all answered."""
        apart = np.diff(samples.time, prepend=samples.time[0] - self.period) / self.period
        clean = samples.valid.all(axis=1) & ~samples.late & (np.abs(apart - 1) < 0.1)
        if self.virtual_time:
            assert clean.all()
        return clean

    def attempts(self, samples_of, rows):
        """Streams until the first `rows` of one are undisturbed; the others are no evidence."""
        for _ in range(20):
            samples = samples_of()
            if self.undisturbed(samples)[:rows].all():
                yield samples
                return
        pytest.fail("twenty streams in a row were disturbed: this machine has no time")

    def open(self, homing_method=PRESENT_POSITION, tap=None):
        """A stage on this bus; most tests don't care where its zero is."""
        axes = [dataclasses.replace(axis, homing_method=homing_method) for axis in self.axes]
        return Stage.open(self.bus, axes, tap=tap)

    @contextlib.contextmanager
    def other(self):
        """Another participant's end of the same bus."""
        with can.Bus(interface=self.bus.interface, channel=self.bus.channel) as bus:
            yield bus


def _lockstep(machine):
    bus, axes = driver_settings(machine)
    _, world = switch_on(machine, start=START)
    yield Rig(dataclasses.replace(bus, interface="lockstep", channel=world.name), axes, True)


def _virtual(machine):
    from hil_sim.bus import serve
    from hil_sim.stage import VirtualStage

    bus, axes = driver_settings(machine)
    settings = dataclasses.replace(stage_settings(machine), sync_period=REAL_TIME_PERIOD)
    drives = VirtualStage(settings, seed=1, start=START)
    drives.plant.advance_to(1_000_000)
    channel = f"hil-{uuid.uuid4().hex}"
    stop = threading.Event()
    with can.Bus(interface="virtual", channel=channel) as theirs:
        realtime = RealTime(RealTimeSettings(priority=PRIORITY))

        def server():
            realtime.begin()
            serve(drives, theirs, stop)

        thread = threading.Thread(target=server)
        thread.start()
        yield Rig(_in_real_time(bus, "virtual", channel, REAL_TIME_PERIOD), axes, False)
        stop.set()
        thread.join(60.0)
        assert not thread.is_alive()
        realtime.end()


def _in_real_time(bus, interface, channel, period):
    if period == GUEST_PERIOD:
        bus = dataclasses.replace(bus, max_missed=GUEST_MAX_MISSED)
    return dataclasses.replace(
        bus, interface=interface, channel=channel, sync_period=period,
        realtime=RealTimeSettings(priority=_priority(period)),
    )  # fmt: skip


def _priority(period):
    """In a guest it would only keep the guest's own kernel threads from the processor."""
    return 0 if period == GUEST_PERIOD else PRIORITY


def _process(machine, interface, channel, period=REAL_TIME_PERIOD):
    bus, axes = driver_settings(machine)
    command = [
        sys.executable, str(Path(__file__).with_name("serve.py")),
        interface, channel, str(period), *map(str, START), str(_priority(period)),
        *filter(None, [machine.axes["x"].drive.profile]),
    ]  # fmt: skip
    root = str(Path(__file__).parents[2])
    path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": path},
    ) as server:
        assert server.stdout is not None
        assert server.stdin is not None
        assert server.stdout.readline() == b"ready\n"
        yield Rig(_in_real_time(bus, interface, channel, period), axes, False)
        server.stdin.close()
        assert server.wait(60.0) == 0


def _udp_multicast(machine):
    with pytest.MonkeyPatch.context() as patch:
        require_multicast_on_own_port(MULTICAST_GROUP, patch)
        yield from _process(machine, "udp_multicast", MULTICAST_GROUP)


def _socketcan(machine):
    with Path("/proc/cpuinfo").open() as file:
        guest = "User Mode Linux" in file.read()
    period = GUEST_PERIOD if guest else REAL_TIME_PERIOD
    yield from _process(machine, "socketcan", os.environ["STAGECTL_HIL_SOCKETCAN"], period)


RIGS = {
    "lockstep": _lockstep,
    "virtual": _virtual,
    "udp_multicast": _udp_multicast,
}
if os.environ.get("STAGECTL_HIL_SOCKETCAN"):
    RIGS["socketcan"] = _socketcan


IN_REAL_TIME = [pytest.param(n, marks=pytest.mark.real_time) for n in RIGS if n != "lockstep"]


def pytest_generate_tests(metafunc):
    """In lockstep all that the driver does; on each bus what depends on one (mark `every_bus`)."""
    if "rig" in metafunc.fixturenames:
        everywhere = metafunc.definition.get_closest_marker("every_bus") is not None
        buses = ["lockstep", *(IN_REAL_TIME if everywhere else ())]
        metafunc.parametrize("rig", buses, indirect=True, scope="module")


@pytest.fixture(scope="module")
def rig(request, stage_machine):
    """The drives behind one kind of bus, switched on once per module."""
    yield from RIGS[request.param](stage_machine)


@pytest.fixture
def booted(rig):
    """A stage on the rig, booted; whatever the test left behind is stopped and closed."""
    with rig.open() as stage:
        stage.boot()
        yield stage


@pytest.fixture
def stage(booted):
    """Booted, faults of earlier tests reset, homed and enabled."""
    booted.reset_faults()
    booted.home()
    booted.enable()
    return booted


def hold(stage, count):
    """Setpoints that keep all axes where their setpoints are now, with their offsets."""
    return np.tile(stage.targets, (count, 1)), np.tile(stage.offsets, (count, 1))


def travel_to(stage, target, duration, period):
    """Setpoints of a smooth (fifth order) motion from the present targets to `target` [m]."""
    s = np.arange(1, round(duration / period) + 1) * period / duration
    shape = s**3 * (10 - 15 * s + 6 * s**2)
    start = np.array(stage.targets)
    position = start + shape[:, None] * (np.array(target) - start)
    return position, np.zeros_like(position)


@pytest.fixture(name="hold")
def _hold():
    return hold


@pytest.fixture(name="travel_to")
def _travel_to():
    return travel_to
