"""What the virtual drive takes of what it receives."""

import struct


def test_last_rpdo_before_the_sync_counts(host):
    host.nmt(1)
    for target in (1, 2, 3):
        host.send(0x201, struct.pack("<Hih", 0, target, 0))
    assert host.read_object(1, 0x607A, 0, "i") == 0
    host.send(0x080)
    assert host.read_object(1, 0x607A, 0, "i") == 3


def test_wrong_length_is_announced_once(host):
    host.nmt(1)
    for _ in range(3):
        host.send(0x201, b"\0\0\0")
    (emcy,) = host.take(0x081)
    assert struct.unpack_from("<H", emcy.data) == (0x8210,)
    host.write(1, 0x1400, 1, "I", 0x80000201)
    host.write(1, 0x1600, 0, "B", 0)
    host.write(1, 0x1600, 0, "B", 2)
    host.write(1, 0x1400, 1, "I", 0x201)
    host.send(0x201, struct.pack("<Hih", 0, 9, 0))
    host.send(0x080)
    assert struct.unpack_from("<H", host.take(0x081)[0].data) == (0x8220,)
    assert host.read_object(1, 0x607A, 0, "i") == 9
