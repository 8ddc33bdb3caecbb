"""PDO parameters by the book, beyond what the conformance checks ask."""

import struct

import pytest

from tests.unit.hil_sim.cia301.mapping import OFF, VALID_T1


def test_an_entry_of_another_width_is_refused(host):
    host.write(1, 0x1800, 1, "I", VALID_T1 | OFF)
    host.write(1, 0x1A00, 0, "B", 0)

    refused = host.refusal(lambda: host.write(1, 0x1A00, 1, "I", 0x60640010))
    assert refused == 0x06040041  # 32 bits wide


def test_cob_id_rules(host):
    def cob(value):
        return host.refusal(lambda: host.write(1, 0x1800, 1, "I", value))

    assert cob(0x40000281) == 0x06090030  # not while it is valid
    host.write(1, 0x1800, 1, "I", VALID_T1 | OFF)
    assert cob(0x60000181) == 0x06090030  # 11 bits only
    assert cob(0x40000601) == 0x06090030  # SDO's
    assert host.refusal(lambda: host.write(1, 0x1800, 2, "B", 252)) == 0x06090030  # RTR only


@pytest.mark.parametrize(("communication", "cob"), [(0x1400, 0x201), (0x1800, 0x181)])
@pytest.mark.parametrize("no_rtr", [0, 1 << 30])
def test_bit_30_is_kept_as_written(host, communication, cob, no_rtr):
    """Masters made by Lely's dcfgen, ros2_canopen's among them, clear it."""
    host.write(1, communication, 1, "I", cob | no_rtr | OFF)
    host.write(1, communication, 1, "I", cob | no_rtr)
    assert host.read_object(1, communication, 1, "I") == cob | no_rtr
    host.write(1, communication, 1, "I", cob | no_rtr)  # the same again, while valid
    host.write(1, communication, 1, "I", cob | no_rtr ^ 1 << 30)  # not one of bits 0 to 29
    host.nmt(1)
    host.send(0x201, struct.pack("<Hih", 0x06, 0, 0))
    host.send(0x080)
    host.send(0x080)
    assert [f.data[0] & 0x6F for f in host.take(0x181)] == [0x40, 0x21]


@pytest.mark.parametrize("communication", [0x1400, 0x1800])
def test_transmission_types(host, communication):
    for kind in (0, 1, 240, 254, 255):
        host.write(1, communication, 2, "B", kind)
    for kind in (241, 251, 252, 253):
        refused = host.refusal(lambda k=kind: host.write(1, communication, 2, "B", k))
        assert refused == 0x06090030
