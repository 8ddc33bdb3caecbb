"""A virtual drive on a lock-step bus, whose frames may be altered on their way out."""

import itertools
from contextlib import contextmanager

import can
import pytest

from drivers.canopen import Network
from drivers.commissioning.conformance import Verdict
from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import stage_settings

_names = itertools.count()


class Altering:
    """A node's connection on which frames are altered on their way out, or swallowed."""

    def __init__(self, world, alter):
        self._world, self._alter = world, alter

    @property
    def now_ns(self):
        return self._world.now_ns

    def emit(self, can_id, data):
        altered = self._alter(can_id, data)
        if altered is not None:
            self._world.emit(can_id, altered)

    def __getattr__(self, name):
        return getattr(self._world, name)


@contextmanager
def network(machine, alter=lambda i, d: d):
    world = World(f"conformance-{next(_names)}")
    stage = VirtualStage(stage_settings(machine), seed=1)
    stage.attach(Altering(world, alter))  # type: ignore[arg-type]
    with can.Bus(interface="lockstep", channel=world.name) as bus:
        made = Network(bus, "lockstep", beats=False)
        made.pump(0.05)
        yield made, stage


def world_of(network):
    return network.bus.world  # type: ignore[union-attr, no-any-return]


@pytest.fixture(scope="module")
def machine():
    return load_machine()


def failures(findings):
    return {f.name for f in findings if f.verdict is not Verdict.PASS}
