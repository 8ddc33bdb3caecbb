"""The SDO client protocol, frame by frame."""

import struct
from binascii import crc_hqx

import pytest
from canopen import SdoAbortedError

from drivers.canopen import sdo


def head(command, index=0x2000, sub=1):
    return struct.pack("<BHB", command, index, sub)


def answers(transfer, *frames):
    """What the client sent after each answer, and what it returned."""
    sent = [next(transfer)]
    for frame in frames:
        try:
            sent.append(transfer.send(frame.ljust(8, b"\0")))
        except StopIteration as end:
            return sent, end.value
    return sent, None


def test_expedited_both_ways():
    sent, value = answers(sdo.upload(0x2000, 1), head(0x4B) + b"\x34\x12")
    assert sent == [head(0x40) + bytes(4)]
    assert value == b"\x34\x12"
    sent, value = answers(sdo.download(0x2000, 1, b"\x34\x12"), head(0x60))
    assert sent == [head(0x2B) + b"\x34\x12\0\0"]
    assert value == b""


def test_answers_to_other_requests_are_ignored():
    sent, value = answers(
        sdo.upload(0x2000, 1),
        head(0x4F, 0x2000, 2) + b"\x99",  # another sub-index
        head(0x4F, 0x3000, 1) + b"\x99",
        head(0x60),  # a write of this object
        head(0x80, 0x3000, 1) + b"\0\0\2\6",  # another transfer's abort
        head(0x4F) + b"\x07",
    )
    assert sent[1:] == [None] * 4
    assert value == b"\x07"


def test_a_repeated_segment_is_ignored():
    sent, value = answers(
        sdo.upload(0x2000, 1),
        head(0x41) + struct.pack("<I", 9),
        b"\x00abcdefg",
        b"\x00ABCDEFG",  # the first one again
        b"\x1bhi",
    )
    assert value == b"abcdefghi"
    assert sent[3] is None


def test_an_upload_longer_than_announced_is_an_error():
    with pytest.raises(SdoAbortedError):
        answers(sdo.upload(0x2000, 1), head(0x41) + struct.pack("<I", 3), b"\x01abcdefg")


def test_block_upload_asks_again_from_the_last_good_segment():
    data = bytes(range(20))
    crc = struct.pack("<H", crc_hqx(data, 0))
    sent, value = answers(
        sdo.block_upload(0x2000, 1),
        head(0xC6) + struct.pack("<I", 20),
        b"\x01" + data[:7],
        b"\x83" + data[14:].ljust(7, b"\0"),  # the second was lost
        b"\x01" + data[7:14],
        b"\x82" + data[14:].ljust(7, b"\0"),
        b"\xc5" + crc,
    )
    assert sent[1] == b"\xa3" + bytes(7)
    assert sent[3] == b"\xa2\x01\x7f" + bytes(5)
    assert sent[5] == b"\xa2\x02\x7f" + bytes(5)
    assert value == data


def test_block_upload_with_a_wrong_checksum_is_refused():
    with pytest.raises(SdoAbortedError, match="05040004"):
        answers(sdo.block_upload(0x2000, 1), head(0xC6), b"\x81abcdefg", b"\xc1\x01\x02")
