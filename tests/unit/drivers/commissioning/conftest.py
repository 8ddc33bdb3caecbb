"""A virtual drive on a lock-step bus, whose frames may be altered on their way out."""

from contextlib import contextmanager

import can
import pytest

from drivers.canopen import Network
from drivers.commissioning.conformance import Verdict
from stagectl.config.machine.file import load_machine
from tests.lockstep import switch_on


@contextmanager
def network(machine, alter=None):
    stage, world = switch_on(machine, alter=alter)
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
    return {f.check for f in findings if f.verdict is not Verdict.PASS}
