"""Commands called in this process."""

import struct

import can
import pytest
from click.testing import CliRunner

from hil_sim.cia301 import Dictionary
from stagectl.cli import cli


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
def odd_drive(monkeypatch):
    """Makes virtual drives hold another value of an object than the one written."""

    def make(key, held):
        store = Dictionary.set_data

        def set_data(self, index, sub, data, check_writable=False):
            store(self, index, sub, data, check_writable)
            if index << 8 | sub == key:
                self.values[key] = held(self.values[key])

        monkeypatch.setattr(Dictionary, "set_data", set_data)

    return make
