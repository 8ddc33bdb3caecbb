"""A host on a bus with a plan of faults, and names for worlds."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import can
import pytest

from hil_sim.bus import FaultyWorld
from hil_sim.bus import faults as f
from hil_sim.stage import VirtualStage

_names = (f"bus-{n}" for n in itertools.count())


class Bench:
    """A host on a bus with a plan of faults; both drives enabled in csp by `enable`."""

    def __init__(self, make_host, settings, plant, plan, extra=()):
        self.plant = plant
        self.world = FaultyWorld(next(_names), plan)
        self.stage = VirtualStage(settings, seed=1, plant=plant)
        self.world.power_on(self.stage)
        self.bus = can.Bus(interface="lockstep", channel=self.world.name)
        self.host = make_host(self.bus)
        self.host.wait(30)

    @property
    def counts(self):
        return [entry.count for entry in self.world.injected]

    def enable(self):
        self.host.map_for_csp()
        self.host.nmt(1)
        for node in (1, 2):
            self.host.enable(8, node)

    def cycle(self, count=1):
        """SYNCs without setpoints; the TPDOs of both drives as they came, by cycle."""
        got = []
        for _ in range(count):
            self.host.take(0x181), self.host.take(0x182)
            self.host.send(0x080)
            got.append((self.host.take(0x181), self.host.take(0x182)))
            self.host.wait(1)
        return got


@pytest.fixture
def bench(make_host, stage_settings, plant) -> Iterator[Callable[..., Bench]]:
    made = []

    def make(*faults: f.Fault, seed: int = 0) -> Bench:
        made.append(Bench(make_host, stage_settings, plant, f.FaultPlan(faults, seed)))
        return made[-1]

    yield make
    for one in made:
        one.bus.shutdown()


@pytest.fixture
def name() -> str:
    return next(_names)


@pytest.fixture
def bus(name):
    with can.Bus(interface="lockstep", channel=name) as bus:
        yield bus
