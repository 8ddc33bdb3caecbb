"""Frames in words."""

import struct

import pytest

from stagectl.config.machine.file import load_machine
from stagectl.run.replay import frame_meaning


@pytest.mark.parametrize(
    ("can_id", "data", "words"),
    [
        (0x000, "8102", ["NMT reset", "node 2"]),
        (0x000, "0100", ["NMT start", "all nodes"]),
        (0x080, "", ["SYNC"]),
        (0x080, "07", ["SYNC 7"]),
        (0x082, "1186210000000000", ["emergency of axis y", "following error"]),
        (0x701, "05", ["heartbeat of axis x", "operational"]),
        (0x77F, "05", ["heartbeat of the host"]),
        (0x601, "4041600000000000", ["request to axis x", "read 0x6041:00"]),
        (0x601, "2b40600006000000", ["write 0x6040:00 = 6"]),
        (0x582, "6040600000000000", ["answer of axis y", "0x6040:00 written"]),
        (0x582, "8064600000000206", ["0x6064:00 aborted, 0x06020000"]),
        (0x581, "0011223344556677", ["segment or block"]),
        (0x3AB, "00", ["id 0x3AB, 1 bytes"]),
    ],
)
def test_services(can_id, data, words):
    text = frame_meaning(can_id, bytes.fromhex(data), load_machine())
    for word in words:
        assert word in text


def test_process_data_in_si_units():
    machine = load_machine()
    unit = machine.axes["y"].drive.rated_force / 1000
    sent = frame_meaning(0x202, struct.pack("<Hih", 0x000F, -12_345_678, 25), machine)
    assert "RPDO 1 of axis y: enable operation (0x000F), target -0.0123456780 m" in sent
    assert f"force offset {25 * unit:.4g} N" in sent
    got = frame_meaning(0x181, struct.pack("<Hih", 0x1237, 1, 0), machine)
    assert "TPDO 1 of axis x: OPERATION ENABLED (0x1237), position 0.0000000010 m" in got
