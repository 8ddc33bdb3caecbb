"""Objects that describe this axis."""

import struct


def test_units_and_limits_are_those_of_the_axis(host):
    assert host.read_object(1, 0x6076, 0, "I") == 40_000
    assert host.read_object(1, 0x607D, 2, "i") == 150_000_000
    assert host.read_object(1, 0x6065, 0, "I") == 1_000_000
    (kp,) = struct.unpack("<d", host.upload(1, 0x2000, 1))
    assert kp == 341e3
    resolution = host.read_object(1, 0x608F, 1, "I") / host.read_object(1, 0x608F, 2, "I")
    feed = host.read_object(1, 0x6092, 1, "I") / host.read_object(1, 0x6092, 2, "I")
    assert feed / resolution == 1.0  # nm per increment
