"""Deviations in motion are found, or reported as not offered."""

import struct

from drivers.commissioning.conformance import Verdict, run
from tests.unit.drivers.commissioning.conftest import network


def test_a_drive_without_acknowledge_in_pp(machine):
    """No bit 12 ever: reported as not offered, the rest still checked."""

    def alter(can_id, data):
        if can_id == 0x581 and data[1:4] == b"\x41\x60\x00":
            word = struct.unpack_from("<H", data, 4)[0] & ~0x1000
            return data[:4] + struct.pack("<H", word) + data[6:]
        return data

    with network(machine, alter) as (bus, _):
        findings = run(bus, 1)
    by_name = {f.check: f for f in findings}
    assert by_name["bit 12 rises with bit 4"].verdict is Verdict.ABSENT
    assert by_name["bit 10: target reached"].verdict is Verdict.PASS
    assert by_name["bit 12: follows the command value"].verdict is Verdict.FAIL
