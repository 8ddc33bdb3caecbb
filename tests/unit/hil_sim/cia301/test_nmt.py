"""NMT slave: boot-up, commands, heartbeats produced and consumed."""

import struct

import pytest

HEARTBEAT = 0x701
EMCY = 0x081


def test_boot_up_then_identity(host):
    (boot,) = host.take(HEARTBEAT)
    assert boot.data == b"\x00"
    assert boot.time_ns == 20_000_000
    assert host.read_object(1, 0x1018, 1, "I") == 0x00535447
    assert host.read_object(2, 0x1018, 4, "I") == 2
    assert host.upload(1, 0x1008, 0) == b"stagectl linear drive"


@pytest.mark.parametrize("node", [0, 128, 255])
def test_unused_heartbeat_consumers_do_nothing(host, node):
    host.write(1, 0x1016, 1, "I", node << 16 | 10)
    host.write(1, 0x1016, 2, "I", node << 16 | 10)
    assert host.read_object(1, 0x1016, 2, "I") == node << 16 | 10
    host.send(0x700 | node & 0x7F, b"\x05")
    host.wait(30)
    assert host.take(EMCY) == []


def test_lost_heartbeat_leaves_operational(streaming):
    streaming.write(1, 0x1016, 1, "I", 127 << 16 | 50)
    streaming.write(1, 0x1017, 0, "H", 10)
    streaming.send(0x77F, b"\x05")
    streaming.wait(100)
    assert streaming.take(HEARTBEAT)[-1].data == bytes((127,))


def test_stopped_node_answers_no_sdo_and_no_sync(streaming):
    streaming.nmt(2)
    streaming.send(0x080)
    streaming.send(0x601, struct.pack("<BHB4x", 0x40, 0x1000, 0))
    assert streaming.take(0x181) == streaming.take(0x581) == []
    streaming.nmt(128)
    assert streaming.statusword() & 0x4F == 0x08  # 0x6007 = 1: fault


def test_reset_node_forgets_everything_and_boots(streaming, plant):
    streaming.write(1, 0x6083, 0, "I", 77)
    streaming.stream(range(0, 100_000, 10_000))
    streaming.take(HEARTBEAT)
    streaming.nmt(129, 1)
    streaming.wait(30)
    assert [f.data for f in streaming.take(HEARTBEAT)] == [b"\x00"]
    assert not plant.powered[0]
    assert streaming.read_object(1, 0x6083, 0, "I") == 1_000_000
    assert streaming.read_object(1, 0x6064, 0, "i") == 0
    assert streaming.statusword() & 0x4F == 0x40


def test_reset_communication_keeps_the_application(host):
    host.write(1, 0x6083, 0, "I", 77)
    host.write(1, 0x1017, 0, "H", 10)
    host.nmt(130, 1)
    host.wait(30)
    assert host.read_object(1, 0x6083, 0, "I") == 77
    assert host.read_object(1, 0x1017, 0, "H") == 0
