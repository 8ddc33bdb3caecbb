"""Block transfers of the virtual drive's SDO server (CiA 301, 7.2.4.3.10 to 15).

Both directions with CRC-16-CCITT; lost segments are sent again from the last good one on. A client
that names a protocol switch threshold gets small objects by an ordinary upload.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable

from canopen import SdoAbortedError
from canopen.sdo import constants as sdo

from hil_sim.cia301.dictionary import require, require_length

_HEAD = struct.Struct("<BHB")
_CRC, _SIZED = 0x04, 0x02
LONGEST_BLOCK = 127


class BlockUpload:
    """Sends one object to the client.

    Args:
        request: the client's initiation.
        data: the object.
        send: sends a frame.

    Raises:
        SdoAbortedError: an impossible block size.
    """

    def __init__(self, request: bytes, data: bytes, send: Callable[[bytes], None]) -> None:
        _, index, sub = _HEAD.unpack_from(request)
        self.done = False
        self._checked = bool(request[0] & _CRC)
        self._size = self._block_size(request[4])
        self._segments = [data[i : i + 7] for i in range(0, max(1, len(data)), 7)]
        self._crc = crc_hqx(data, 0)
        self._acknowledged = 0
        self._sent = 0
        self._ending = False
        self._send = send
        send(_HEAD.pack(0xC0 | _CRC | _SIZED, index, sub) + struct.pack("<I", len(data)))

    def on_frame(self, data: bytes) -> None:
        """Handle the start, the acknowledgement of a block, or the end."""
        subcommand = data[0] & 0x03
        if subcommand == 1 and self._ending:
            self.done = True
        elif subcommand == 3 and not self._ending and self._sent == 0:
            self._block()
        elif subcommand == 2 and not self._ending and self._sent:
            require(data[1] <= self._sent, sdo.ABORT_INVALID_SEQUENCE_NUMBER)
            self._acknowledged += data[1]
            self._size = self._block_size(data[2])
            if self._acknowledged == len(self._segments):
                self._end()
            else:
                self._block()
        else:
            raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)

    def _block(self) -> None:
        block = self._segments[self._acknowledged : self._acknowledged + self._size]
        self._sent = len(block)
        for number, part in enumerate(block, start=1):
            last = self._acknowledged + number == len(self._segments)
            self._send(bytes((number | last << 7,)) + part.ljust(7, b"\0"))

    def _end(self) -> None:
        self._ending = True
        unused = 7 - len(self._segments[-1])
        crc = self._crc if self._checked else 0
        self._send(bytes((0xC1 | unused << 2,)) + struct.pack("<H5x", crc))

    @staticmethod
    def _block_size(size: int) -> int:
        require(1 <= size <= LONGEST_BLOCK, sdo.ABORT_INVALID_BLOCK_SIZE)
        return size


class BlockDownload:
    """Receives one object from the client.

    Args:
        request: the client's initiation.
        longest: bytes that the server accepts.
        store: called with the object at the end; may raise `SdoAbortedError`.
        send: sends a frame.

    Raises:
        SdoAbortedError: more than `longest`.
    """

    def __init__(
        self,
        request: bytes,
        longest: int,
        store: Callable[[bytes], None],
        send: Callable[[bytes], None],
    ) -> None:
        _, index, sub = _HEAD.unpack_from(request)
        self.receiving = True
        self._checked = bool(request[0] & _CRC)
        self._size = int.from_bytes(request[4:8], "little") if request[0] & _SIZED else None
        require(self._size is None or self._size <= longest, sdo.ABORT_OUT_OF_MEMORY)
        self._longest = longest
        self._data = bytearray()
        self._good = 0
        self._complete = False
        self._store, self._send = store, send
        send(_HEAD.pack(0xA0 | _CRC, index, sub) + bytes((LONGEST_BLOCK, 0, 0, 0)))

    def on_segment(self, data: bytes) -> None:
        """Take one segment of a block; segments out of sequence are requested again."""
        number, last = data[0] & 0x7F, bool(data[0] & 0x80)
        if number == self._good + 1:
            self._good = number
            self._data += data[1:]
            self._complete = last
            require(len(self._data) <= self._longest + 7, sdo.ABORT_OUT_OF_MEMORY)
        if last or number == LONGEST_BLOCK:
            self._send(bytes((0xA2, self._good, LONGEST_BLOCK, 0, 0, 0, 0, 0)))
            self._good = 0
            self.receiving = not self._complete

    def on_end(self, data: bytes) -> None:
        """Check the client's checksum, store the value and acknowledge it."""
        require(data[0] & 0x03 == 1, sdo.ABORT_INVALID_COMMAND_SPECIFIER)
        unused = data[0] >> 2 & 0x07
        value = bytes(self._data[: len(self._data) - unused])
        (crc,) = struct.unpack_from("<H", data, 1)
        require(not self._checked or crc == crc_hqx(value, 0), sdo.ABORT_CRC_ERROR)
        if self._size is not None:
            require_length(len(value), self._size)
        self._store(value)
        self._send(bytes((0xA1, 0, 0, 0, 0, 0, 0, 0)))
