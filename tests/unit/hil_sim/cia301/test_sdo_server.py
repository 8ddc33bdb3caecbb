"""SDO: abort codes beyond those of the conformance checks, segments, senseless frames."""

import struct
from binascii import crc_hqx

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


def test_a_small_object_is_uploaded_expedited_below_the_switch_threshold(host):
    answer = host.request(1, struct.pack("<BHBBB2x", 0xA4, 0x1000, 0, 127, 8))
    assert answer[0] & 0xE0 == 0x40
    assert struct.unpack_from("<I", answer, 4) == (0x00020192,)


NAME = b"stagectl linear drive"  # 0x1008: three segments


def block_upload(host, size=127):
    """The initiation and the first block."""
    answer = host.request(1, struct.pack("<BHBBB2x", 0xA4, 0x1008, 0, size, 0))
    assert answer[0] == 0xC6
    assert struct.unpack_from("<I", answer, 4) == (len(NAME),)
    host.send(0x601, b"\xa3".ljust(8, b"\0"))
    return [f.data for f in host.take(0x581)]


def acknowledge(host, count, size=127):
    host.send(0x601, bytes((0xA2, count, size, 0, 0, 0, 0, 0)))
    return [f.data for f in host.take(0x581)]


def test_block_upload_repeats_from_the_last_good_segment_and_takes_a_new_block_size(host):
    assert [f[0] for f in block_upload(host, size=2)] == [1, 2]
    again = acknowledge(host, 1, size=1)
    assert [(f[0], f[1:]) for f in again] == [(1, NAME[7:14])]
    last = acknowledge(host, 1, size=5)
    assert [(f[0], f[1:]) for f in last] == [(0x81, NAME[14:])]
    assert acknowledge(host, 1)[0][0] == 0xC1


@pytest.mark.parametrize("size", [0, 128])
def test_an_impossible_block_size_is_refused(host, size):
    request = struct.pack("<BHBBB2x", 0xA4, 0x1008, 0, size, 0)
    assert host.refusal(lambda: host.request(1, request)) == 0x05040002


def block_download(host, value, index=0x607C, sub=0, lost=(), crc=None):
    """A block download of one block; segments in `lost` don't arrive the first time."""
    host.request(1, struct.pack("<BHBI", 0xC6, index, sub, len(value)))
    parts = [value[i : i + 7] for i in range(0, len(value), 7)]
    done = 0
    while done < len(parts):
        for n, part in enumerate(parts[done:], start=1):
            if done + n in lost:
                lost = tuple(x for x in lost if x != done + n)
                continue
            last = 0x80 if done + n == len(parts) else 0
            host.send(0x601, bytes((n | last,)) + part.ljust(7, b"\0"))
        (answer,) = host.take(0x581)
        assert answer.data[0] == 0xA2, answer.data.hex()
        done += answer.data[1]
    crc = crc_hqx(value, 0) if crc is None else crc
    end = bytes((0xC1 | (7 - len(parts[-1])) << 2,)) + struct.pack("<H5x", crc)
    return host.request(1, end)


def test_block_download(host):
    assert block_download(host, struct.pack("<i", -77))[0] == 0xA1
    assert host.read_object(1, 0x607C, 0, "i") == -77


def test_block_download_requests_lost_segments_again(host):
    # more than the object holds: every segment arrives, the length is what is refused
    value = bytes(50)
    assert host.refusal(lambda: block_download(host, value, lost=(2, 5))) == 0x06070012


def test_block_download_with_a_wrong_checksum_stores_nothing(host):
    value = struct.pack("<i", 5)
    assert host.refusal(lambda: block_download(host, value, crc=1)) == 0x05040004
    assert host.read_object(1, 0x607C, 0, "i") == 0


def test_block_download_to_a_read_only_object_is_refused_at_once(host):
    request = struct.pack("<BHBI", 0xC6, 0x6041, 0, 2)
    assert host.refusal(lambda: host.request(1, request)) == 0x06010002
    request = struct.pack("<BHBI", 0xC6, 0x607C, 0, 5000)
    assert host.refusal(lambda: host.request(1, request)) == 0x05040005
