"""Commands called in this process."""

import itertools
import struct

import can
import pytest
from click.testing import CliRunner

from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.cli import cli
from stagectl.config import load_machine, stage_settings

_names = itertools.count()


@pytest.fixture
def call():
    """The command in this process: (exit code or exception, standard output)."""

    def go(*arguments):
        done = CliRunner().invoke(cli, [*map(str, arguments)], env={"COLUMNS": "160"})
        failure = done.exception if done.exit_code == 1 and done.exception else done.exit_code
        return failure, done.stdout, done.stderr

    return go


def enabled(bus, node):
    """Enables a drive by SDO, operational, as another master would; waits for each answer."""
    bus.send(can.Message(arbitration_id=0, data=[1, node], is_extended_id=False))
    for word in (0x06, 0x07, 0x0F):
        data = struct.pack("<BHBH2x", 0x2B, 0x6040, 0, word)
        bus.send(can.Message(arbitration_id=0x600 + node, data=data, is_extended_id=False))
        while (message := bus.recv(60.0)) is not None:
            if message.arbitration_id == 0x580 + node:
                break
        assert message is not None, "no answer"
        assert message.data[0] == 0x60


@pytest.fixture
def odd_drives():
    """Virtual drives to be changed, switched on on a bus in virtual time, and its name."""
    world = World(f"cli-{next(_names)}")
    stage = VirtualStage(stage_settings(load_machine(None)), seed=1)
    stage.attach(world)
    world.sleep_until_ns(100_000_000)
    return stage.drives, f"lockstep:{world.name}"
