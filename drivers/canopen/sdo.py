"""SDO client protocol (CiA 301, 7.2.4) without a bus: expedited, segmented, uploads in blocks.

A transfer is a generator: it yields the frame to send next (None to keep waiting), is sent every
frame received from the server, and returns the object's bytes. A frame that does not answer the
present request (another object or service, an old toggle bit) is ignored: it is late, or meant for
another client. `sdo_channel.py` runs transfers on a bus.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable, Generator

from canopen import SdoAbortedError

Transfer = Generator["bytes | None", bytes, bytes]

TIMED_OUT = 0x05040000
UNKNOWN_COMMAND = 0x05040001
_CRC_ERROR = 0x05040004
_GENERAL_ERROR = 0x08000000

BLOCK_SEGMENTS = 127
_HEAD = struct.Struct("<BHB")
_EXPEDITED, _SIZED = 0x02, 0x01


def abort_frame(index: int, sub: int, code: int) -> bytes:
    """The client's abort of a transfer."""
    return _HEAD.pack(0x80, index, sub) + struct.pack("<I", code)


def upload(index: int, sub: int) -> Transfer:
    """Reads an object, expedited or segmented as the server chooses."""
    answer = yield from _initiate(_request(0x40, index, sub), index, sub, 0x40)
    return (yield from _rest_of_upload(answer, index, sub))


def download(index: int, sub: int, data: bytes) -> Transfer:
    """Writes an object, expedited up to four bytes, else segmented."""
    if 0 < len(data) <= 4:
        command = 0x20 | (4 - len(data)) << 2 | _EXPEDITED | _SIZED
        yield from _initiate(_request(command, index, sub, data), index, sub, 0x60)
        return b""
    size = struct.pack("<I", len(data))
    yield from _initiate(_request(0x20 | _SIZED, index, sub, size), index, sub, 0x60)
    toggle = 0
    for start in range(0, max(1, len(data)), 7):
        part = data[start : start + 7]
        last = start + 7 >= len(data)
        frame = bytes((toggle | (7 - len(part)) << 1 | last,)) + part.ljust(7, b"\0")
        yield from _segment(frame, index, sub, 0x20 | toggle)
        toggle ^= 0x10
    return b""


def block_upload(index: int, sub: int) -> Transfer:
    """Reads an object in blocks; the server may answer with an ordinary upload."""
    frame = _HEAD.pack(0xA4, index, sub) + bytes((BLOCK_SEGMENTS, 0, 0, 0))
    answer = yield from _initiate(frame, index, sub, 0xC0, 0x40)
    if answer[0] & 0xE0 == 0x40:
        return (yield from _rest_of_upload(answer, index, sub))
    checked = bool(answer[0] & 0x04)
    data = bytearray()
    send: bytes | None = bytes((0xA3, 0, 0, 0, 0, 0, 0, 0))
    finished = False
    while not finished:
        sequence, complete = 0, False
        while not complete:
            answer = yield send
            send = None
            if answer[0] == 0x80:
                _check_abort(answer, index, sub)
                continue
            number = answer[0] & 0x7F
            if number == sequence + 1:  # else the server repeats from the last good one on
                sequence = number
                data += answer[1:]
                finished = bool(answer[0] & 0x80)
            complete = finished or number >= BLOCK_SEGMENTS or bool(answer[0] & 0x80)
        send = bytes((0xA2, sequence, BLOCK_SEGMENTS, 0, 0, 0, 0, 0))
    answer = yield from _answer(send, index, sub, lambda frame: frame[0] & 0xE3 == 0xC1)
    unused = answer[0] >> 2 & 0x07
    if unused:
        del data[-unused:]
    if checked and crc_hqx(bytes(data), 0) != struct.unpack_from("<H", answer, 1)[0]:
        raise SdoAbortedError(_CRC_ERROR)
    return bytes(data)


BLOCK_UPLOAD_END = bytes((0xA1, 0, 0, 0, 0, 0, 0, 0))
"""Ends a block upload; sent by the channel, since no answer follows."""


def _request(command: int, index: int, sub: int, data: bytes = b"") -> bytes:
    return _HEAD.pack(command, index, sub) + data.ljust(4, b"\0")


def _check_abort(answer: bytes, index: int, sub: int) -> None:
    """Raises the server's abort of this transfer, if the frame is one."""
    command, its_index, its_sub = _HEAD.unpack_from(answer)
    # some servers omit the object when they abort a segment
    if command == 0x80 and (its_index, its_sub) in ((index, sub), (0, 0)):
        raise SdoAbortedError(struct.unpack_from("<I", answer, 4)[0])


def _answer(
    frame: bytes | None, index: int, sub: int, is_answer: Callable[[bytes], bool]
) -> Transfer:
    """Sends a frame and returns the server's answer to it; raises the server's abort."""
    answer = yield frame
    while not is_answer(answer):
        _check_abort(answer, index, sub)
        answer = yield None
    return answer


def _initiate(frame: bytes, index: int, sub: int, *services: int) -> Transfer:
    def is_answer(answer: bytes) -> bool:
        return answer[0] & 0xE0 in services and _HEAD.unpack_from(answer)[1:] == (index, sub)

    return _answer(frame, index, sub, is_answer)


def _segment(frame: bytes, index: int, sub: int, expected: int) -> Transfer:
    """One segment: `expected` holds service (bits 7..5) and toggle (bit 4) of the answer."""
    return _answer(frame, index, sub, lambda answer: answer[0] & 0xF0 == expected)


def _rest_of_upload(answer: bytes, index: int, sub: int) -> Transfer:
    if answer[0] & _EXPEDITED:
        size = 4 - (answer[0] >> 2 & 3) if answer[0] & _SIZED else 4
        return answer[4 : 4 + size]
    announced = struct.unpack_from("<I", answer, 4)[0] if answer[0] & _SIZED else None
    data = b""
    toggle = 0
    while True:
        part = yield from _segment(bytes((0x60 | toggle,)) + bytes(7), index, sub, toggle)
        data += part[1 : 8 - (part[0] >> 1 & 7)]
        if part[0] & 1:
            break
        toggle ^= 0x10
    if announced is not None and announced != len(data):
        raise SdoAbortedError(_GENERAL_ERROR)
    return data
