"""What the virtual drive sends, and when."""

import struct

import pytest

from tests.unit.hil_sim.cia301.mapping import OFF, VALID_T1, remap


@pytest.fixture
def other(host):
    """TPDO 1 switched off on both nodes, so that only what a test sets up is heard."""
    for node in (1, 2):
        host.write(node, 0x1800, 1, "I", 0xC0000180 + node)
    return host


def test_remapped_tpdo(other):
    remap(other, 0x1A01, 0x1801, [0x60610008, 0x60640020, 0x60410010], 0x40000281)
    other.nmt(1)
    other.send(0x080)
    (frame,) = other.take(0x281)
    assert struct.unpack("<biH", frame.data)[:2] == (0, 0)


def test_type_0_sends_when_changed(other):
    remap(other, 0x1A00, 0x1800, [0x60410010], VALID_T1, kind=0)
    other.nmt(1)
    counts = []
    for k in range(4):
        if k == 2:
            other.control(0x06)
        other.send(0x080)
        counts.append(len(other.take(0x181)))
    assert counts == [1, 0, 1, 0]


def test_event_driven_with_timer_and_inhibit(other):
    remap(other, 0x1A00, 0x1800, [0x60410010], VALID_T1 | OFF, kind=255)
    other.write(1, 0x1800, 3, "H", 50)  # 5 ms
    other.write(1, 0x1800, 5, "H", 20)  # ms
    other.write(1, 0x1800, 1, "I", VALID_T1)
    other.nmt(1)
    start = other.clock.now_ns()
    assert len(other.take(0x181)) == 1
    other.control(0x06)  # inside the inhibit time: deferred
    assert other.take(0x181) == []
    other.wait(60)
    stamps = [f.time_ns - start for f in other.take(0x181)]
    assert stamps == [5_000_000, 25_000_000, 45_000_000]
    other.control(0x07)
    assert len(other.take(0x181)) == 1
