"""SDO server of the virtual drive: expedited, segmented and block transfers, CiA 301 abort codes.

canopen's server on the drive's dictionary and bus segment, completed: an access is refused before
the first segment, toggle bit and size of a segmented download are checked, and so are segments that
belong to no transfer. Block transfers go both ways with CRC-16-CCITT (7.2.4.3.10 to 15): lost
segments are sent again from the last good one on, and a client that names a protocol switch
threshold gets small objects by an ordinary upload.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable

from canopen import SdoAbortedError
from canopen.sdo import constants as sdo
from canopen.sdo.server import SdoServer

from hil_sim.cia301.object_dictionary import Dictionary, require, require_length
from hil_sim.ports import CanSegment

_MAX_DOWNLOAD = 4096  # bytes; a real drive's buffer is limited, too


class DriveSdoServer(SdoServer):
    """Answers requests on 0x600 + node with responses on 0x580 + node."""

    def __init__(
        self,
        node_id: int,
        dictionary: Dictionary,
        segment: CanSegment,
        long_answers: bool = False,
    ) -> None:
        """With `long_answers`, expedited uploads say that all four bytes are data."""
        super().__init__(0x600 + node_id, 0x580 + node_id, dictionary)
        self._long_answers = long_answers
        self._segment = segment
        self._index = 0
        self._subindex = 0
        self._size: int | None = None
        self._download = False
        self._block: BlockUpload | BlockDownload | None = None

    def reset(self) -> None:
        """Drop the transfer in progress."""
        self._buffer = self._block = None

    def on_frame(self, data: bytes) -> None:
        """Handle a request; a frame of any length but eight is ignored."""
        if len(data) != 8:
            return
        block = self._block
        # only its place in the transfer makes it a segment; 0x80 is an abort
        if isinstance(block, BlockDownload) and block.receiving and data[0] != 0x80:
            try:
                block.on_segment(data)
            except SdoAbortedError as refused:
                self.abort(refused.code)
        else:
            self.on_request(self.rx_cobid, data, 0.0)

    def send_response(self, response: bytes) -> None:
        """Send a response."""
        if self._long_answers and response[0] & 0xE2 == sdo.RESPONSE_UPLOAD | sdo.EXPEDITED:
            response = bytes((response[0] & ~0x0C, *response[1:]))
        self._segment.emit(self.tx_cobid, bytes(response))

    def abort(self, abort_code: int = sdo.ABORT_GENERAL_ERROR) -> None:
        """Abort the transfer in progress."""
        self._buffer = self._block = None
        super().abort(abort_code)

    def request_aborted(self, data: bytes) -> None:
        """Drop the transfer: the client has aborted it."""
        self._buffer = self._block = None
        super().request_aborted(data)

    def init_upload(self, request: bytes) -> None:
        """Answer expedited, or begin a segmented upload."""
        self._download = False
        self._block = None
        super().init_upload(request)

    def segmented_upload(self, command: int) -> None:
        """Send one segment."""
        uploading = self._buffer is not None and not self._download
        require(uploading, sdo.ABORT_INVALID_COMMAND_SPECIFIER)
        super().segmented_upload(command)
        if not self._buffer:
            self._buffer = None

    def init_download(self, request: bytes) -> None:
        """Store an expedited value, or begin a segmented download."""
        command, index, subindex = sdo.SDO_STRUCT.unpack_from(request)
        self._size = None
        self._block = None
        if not command & sdo.EXPEDITED:
            self._index, self._subindex = index, subindex
            self._node.check_writable(index, subindex)
            if command & sdo.SIZE_SPECIFIED:
                self._size = int.from_bytes(request[4:8], "little")
                require(self._size <= _MAX_DOWNLOAD, sdo.ABORT_OUT_OF_MEMORY)
        self._download = True
        super().init_download(request)

    def segmented_download(self, command: int, request: bytes) -> None:
        """Take one segment; the last one stores the value."""
        buffer = self._buffer
        if buffer is None or not self._download:
            raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)
        length = len(buffer) + 7 - ((command >> 1) & 0x7)
        size = _MAX_DOWNLOAD if self._size is None else self._size
        require(length <= size, sdo.ABORT_LENGTH_TOO_HIGH)
        last = bool(command & sdo.NO_MORE_DATA)
        if last and self._size is not None:
            require_length(length, self._size)
        super().segmented_download(command, request)
        if last:
            self._buffer = None

    def block_download(self, data: bytes) -> None:
        """Begin or end a block download; `on_frame` takes its segments."""
        if data[0] & 0x01:
            if not isinstance(self._block, BlockDownload):
                raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)
            self._block.on_end(data)
            self._block = None
            return
        self._buffer = None
        _, index, subindex = sdo.SDO_STRUCT.unpack_from(data)
        self._index, self._subindex = index, subindex
        self._node.check_writable(index, subindex)

        def store(value: bytes) -> None:
            self._node.set_data(index, subindex, value, check_writable=True)

        self._block = BlockDownload(data, _MAX_DOWNLOAD, store, self.send_response)

    def block_upload(self, data: bytes) -> None:
        """Begin, continue or end a block upload."""
        if data[0] & 0x03:
            if not isinstance(self._block, BlockUpload):
                raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)
            self._block.on_frame(data)
            if self._block.done:
                self._block = None
            return
        self._buffer = self._block = None
        _, self._index, self._subindex = sdo.SDO_STRUCT.unpack_from(data)
        value = self._node.get_data(self._index, self._subindex, check_readable=True)
        require(value, sdo.ABORT_NO_DATA_AVAILABLE)
        if len(value) <= data[5]:  # the client's protocol switch threshold
            self.init_upload(data)
        else:
            self._block = BlockUpload(data, value, self.send_response)


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
