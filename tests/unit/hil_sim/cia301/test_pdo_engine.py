"""All PDOs of a node: what a SYNC does with them, in which order, and within which window."""

import itertools
import struct

import pytest

from tests.unit.hil_sim.cia301.mapping import remap

CONTROLWORD, MODE, TARGET = 0x60400010, 0x60600008, 0x607A0020


@pytest.fixture
def enabled(host):
    """Enabled with no mode, at 0; controlword, target and mode in an RPDO each, RPDO 1 to 3."""
    remap(host, 0x1600, 0x1400, [CONTROLWORD], 0x201)
    remap(host, 0x1601, 0x1401, [TARGET], 0x301)
    remap(host, 0x1602, 0x1402, [MODE], 0x401)
    host.write(1, 0x6081, 0, "I", 50_000_000)
    host.enable(0)
    host.nmt(1)
    return host


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_a_command_finds_mode_and_target_of_its_own_sync(host, order):
    """Whichever RPDO carries what: mode pp and its first set-point at once."""
    entries = (CONTROLWORD, MODE, TARGET)
    values = (("<H", 0x3F), ("<b", 1), ("<i", 700_000))
    for number, which in enumerate(order):
        remap(host, 0x1600 + number, 0x1400 + number, [entries[which]], 0x201 + 0x100 * number)
    host.enable(0)
    host.nmt(1)
    for number, which in enumerate(order):
        host.send(0x201 + 0x100 * number, struct.pack(*values[which]))
    host.send(0x080)
    host.wait(500)
    assert host.read_object(1, 0x6064, 0, "i") == 700_000


@pytest.mark.parametrize("kind", [1, 255])
def test_a_frame_with_the_controlword_first_is_stored_before_it_acts(host, kind):
    remap(host, 0x1600, 0x1400, [CONTROLWORD, MODE, TARGET], 0x201, kind)
    host.enable(0)
    host.nmt(1)
    host.send(0x201, struct.pack("<Hbi", 0x3F, 1, 700_000))
    if kind == 1:
        host.send(0x080)
    host.wait(500)
    assert host.read_object(1, 0x6064, 0, "i") == 700_000


def test_a_refused_value_leaves_those_that_came_with_it(enabled):
    enabled.write(1, 0x6060, 0, "b", 1)
    enabled.send(0x401, struct.pack("<b", 7))  # no such mode
    enabled.send(0x301, struct.pack("<i", 400_000))
    enabled.send(0x201, struct.pack("<H", 0x3F))
    enabled.send(0x080)
    enabled.wait(500)
    assert enabled.read_object(1, 0x6061, 0, "b") == 1
    assert enabled.read_object(1, 0x6064, 0, "i") == 400_000


def test_rpdo_later_than_the_window_is_dropped(host):
    host.write(1, 0x1007, 0, "I", 500)
    host.nmt(1)
    host.send(0x080)
    host.wait(0.4)
    host.send(0x201, struct.pack("<Hih", 0, 1, 0))
    host.wait(0.4)
    host.send(0x201, struct.pack("<Hih", 0, 2, 0))
    host.send(0x080)
    assert host.read_object(1, 0x607A, 0, "i") == 1
