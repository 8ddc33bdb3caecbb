"""SDO server of the virtual drive: expedited, segmented and block transfers, CiA 301 abort codes.

canopen's server on the drive's dictionary and bus segment, completed: an access is refused before
the first segment, toggle bit and size of a segmented download are checked, and so are segments that
belong to no transfer. Block transfers are in `sdo_block`.
"""

from __future__ import annotations

from canopen import SdoAbortedError
from canopen.sdo import constants as sdo
from canopen.sdo.server import SdoServer

from hil_sim.cia301.dictionary import Dictionary, require, require_length
from hil_sim.cia301.sdo_block import BlockDownload, BlockUpload
from hil_sim.ports import CanSegment

_MAX_DOWNLOAD = 4096  # bytes; a real drive's buffer is limited, too


class DriveSdoServer(SdoServer):
    """Answers requests on 0x600 + node with responses on 0x580 + node."""

    def __init__(self, node_id: int, dictionary: Dictionary, segment: CanSegment) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, dictionary)
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
