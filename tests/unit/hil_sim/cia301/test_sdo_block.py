"""SDO block transfers: segments lost, checksums, block sizes."""

import struct
from binascii import crc_hqx

import pytest


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
