"""SDO: abort codes beyond those of the conformance checks, segments, senseless frames."""

import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


@pytest.mark.parametrize(
    ("index", "sub", "fmt", "value", "code"),
    [
        (0x607A, 0, "h", 1, 0x06070013),  # too short
        (0x6007, 0, "h", 4, 0x06090031),  # too high
        (0x6007, 0, "h", -1, 0x06090032),  # too low
        (0x60C2, 2, "b", 40, 0x06090031),  # ages
        (0x60C2, 2, "b", -7, 0x06090032),
        (0x1003, 0, "B", 1, 0x06090030),  # only 0 clears
        (0x1005, 0, "I", 0x40000080, 0x06090030),  # produces no SYNC
    ],
)
def test_refused_writes(host, index, sub, fmt, value, code):
    assert host.refusal(lambda: host.write(1, index, sub, fmt, value)) == code


def test_an_empty_history_has_nothing_to_read(host):
    assert host.refusal(lambda: host.read_object(1, 0x1003, 1, "I")) == 0x08000024


def test_duplicate_heartbeat_consumer(host):
    host.write(1, 0x1016, 1, "I", 127 << 16 | 100)
    again = host.refusal(lambda: host.write(1, 0x1016, 2, "I", 127 << 16 | 200))
    assert again == 0x06040043
    host.write(1, 0x1016, 1, "I", 0)
    host.write(1, 0x1016, 2, "I", 127 << 16 | 200)


def segmented(host, index, sub, data, size=None):
    size = len(data) if size is None else size
    host.request(1, struct.pack("<BHBI", 0x21, index, sub, size))
    chunks = [data[i : i + 7] for i in range(0, len(data), 7)]
    for n, chunk in enumerate(chunks):
        head = (n & 1) << 4 | (7 - len(chunk)) << 1 | (n == len(chunks) - 1)
        host.request(1, bytes((head,)) + chunk.ljust(7, b"\0"))


def test_segmented_download(host):
    segmented(host, 0x6081, 0, struct.pack("<I", 42))
    assert host.read_object(1, 0x6081, 0, "I") == 42
    code = host.refusal(lambda: segmented(host, 0x6041, 0, b"\1\2"))
    assert code == 0x06010002  # refused before the first segment
    code = host.refusal(lambda: segmented(host, 0x6081, 0, b"\1\2\3\4", size=3))
    assert code == 0x06070012
    code = host.refusal(lambda: segmented(host, 0x6081, 0, b"\1\2\3", size=4))
    assert code == 0x06070013
    assert host.read_object(1, 0x6081, 0, "I") == 42


def test_toggle_bit_is_checked(host):
    host.request(1, struct.pack("<BHB4x", 0x40, 0x1008, 0))
    host.request(1, b"\x60".ljust(8, b"\0"))
    assert host.refusal(lambda: host.request(1, b"\x60".ljust(8, b"\0"))) == 0x05030000


@pytest.mark.parametrize("command", [0x60, 0x00, 0xA1, 0xA2, 0xA3, 0xC1])
def test_a_segment_outside_a_transfer_is_refused(host, command):
    assert host.refusal(lambda: host.request(1, bytes((command,)).ljust(8, b"\0"))) == 0x05040001


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
@given(st.binary(max_size=8))
def test_any_frame_gets_at_most_one_answer(host, payload):
    host.take(0x581)
    host.send(0x601, payload)
    answers = host.take(0x581)
    assert len(answers) == (len(payload) == 8 and payload[0] & 0xE0 != 0x80)
    host.send(0x601, b"\x80".ljust(8, b"\0"))
    assert host.read_object(1, 0x1000, 0, "I") == 0x00020192
