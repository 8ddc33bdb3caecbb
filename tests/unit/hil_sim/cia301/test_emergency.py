"""EMCY messages, error register and error history."""

EMCY = 0x081


def test_error_history_keeps_the_newest_eight(host, plant):
    host.write(1, 0x1016, 1, "I", 127 << 16 | 10)
    for _ in range(10):
        host.send(0x77F, b"\x05")
        host.wait(15)
    assert host.read_object(1, 0x1003, 0, "B") == 8
    assert host.read_object(1, 0x1003, 8, "I") == 0x8130
    assert host.read_object(1, 0x1001, 0, "B") == 0x11
    host.send(0x77F, b"\x05")
    assert host.read_object(1, 0x1001, 0, "B") == 0  # back again, and no fault to reset
    assert host.take(EMCY)[-1].data[:3] == b"\0\0\0"
    host.write(1, 0x1003, 0, "B", 0)
    assert host.read_object(1, 0x1003, 0, "B") == 0


def test_a_fault_remains_when_the_heartbeat_returns(host):
    host.write(1, 0x1016, 1, "I", 127 << 16 | 10)
    host.enable(8)
    host.send(0x77F, b"\x05")
    host.wait(20)
    host.send(0x77F, b"\x05")
    assert host.statusword() & 0x4F == 0x08
    assert host.read_object(1, 0x603F, 0, "H") == 0x8130
    assert host.control(0x80) & 0x4F == 0x40
    assert host.read_object(1, 0x603F, 0, "H") == 0
