"""SDO server of the virtual drive: expedited and segmented transfers, abort codes of CiA 301.

canopen's server on the drive's own dictionary and bus segment, with what it leaves out: refusal
of an access before the first segment, toggle and size of a segmented download, and segments that
belong to no transfer. Block transfers are refused (download) or answered by a segmented one
(upload), as CiA 301 allows.
"""

from __future__ import annotations

from canopen import SdoAbortedError
from canopen.sdo import constants as sdo
from canopen.sdo.server import SdoServer

from hil_sim.dictionary import Dictionary
from hil_sim.ports import CanSegment

_MAX_DOWNLOAD = 4096  # bytes; a real drive has no endless buffer either


class DriveSdoServer(SdoServer):
    """Answers on 0x580 + node what is asked on 0x600 + node."""

    def __init__(self, node_id: int, dictionary: Dictionary, segment: CanSegment) -> None:
        super().__init__(0x600 + node_id, 0x580 + node_id, dictionary)
        self._segment = segment
        self._index = 0
        self._subindex = 0
        self._size: int | None = None
        self._download = False

    def reset(self) -> None:
        """Forget a transfer under way."""
        self._buffer = None

    def on_frame(self, data: bytes) -> None:
        """Handle a request; anything but eight bytes is no SDO and is passed over."""
        if len(data) == 8:
            self.on_request(self.rx_cobid, data, 0.0)

    def send_response(self, response: bytes) -> None:
        """Send on our segment."""
        self._segment.emit(self.tx_cobid, bytes(response))

    def abort(self, abort_code: int = sdo.ABORT_GENERAL_ERROR) -> None:
        """Abort the transfer under way and say why."""
        self._buffer = None
        super().abort(abort_code)

    def request_aborted(self, data: bytes) -> None:
        """The client gives up."""
        self._buffer = None
        super().request_aborted(data)

    def init_upload(self, request: bytes) -> None:
        """Expedited answer or the first of a segmented one."""
        self._download = False
        super().init_upload(request)

    def segmented_upload(self, command: int) -> None:
        """One segment out."""
        if self._buffer is None or self._download:
            raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)
        super().segmented_upload(command)
        if not self._buffer:
            self._buffer = None

    def init_download(self, request: bytes) -> None:
        """Store an expedited value or begin a segmented download."""
        command, index, subindex = sdo.SDO_STRUCT.unpack_from(request)
        self._size = None
        if not command & sdo.EXPEDITED:
            self._index, self._subindex = index, subindex
            self._node.check_writable(index, subindex)
            if command & sdo.SIZE_SPECIFIED:
                self._size = int.from_bytes(request[4:8], "little")
                if self._size > _MAX_DOWNLOAD:
                    raise SdoAbortedError(sdo.ABORT_OUT_OF_MEMORY)
        self._download = True
        super().init_download(request)

    def segmented_download(self, command: int, request: bytes) -> None:
        """One segment in; the last one stores the value."""
        buffer = self._buffer
        if buffer is None or not self._download:
            raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)
        length = len(buffer) + 7 - ((command >> 1) & 0x7)
        size = _MAX_DOWNLOAD if self._size is None else self._size
        if length > size:
            raise SdoAbortedError(sdo.ABORT_LENGTH_TOO_HIGH)
        last = bool(command & sdo.NO_MORE_DATA)
        if last and self._size is not None and length < self._size:
            raise SdoAbortedError(sdo.ABORT_LENGTH_TOO_LOW)
        super().segmented_download(command, request)
        if last:
            self._buffer = None

    def block_download(self, data: bytes) -> None:
        """Not offered."""
        _, self._index, self._subindex = sdo.SDO_STRUCT.unpack_from(data)
        raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)

    def block_upload(self, data: bytes) -> None:
        """Only its initiation may be answered by an ordinary upload."""
        if data[0] & 0x03:
            raise SdoAbortedError(sdo.ABORT_INVALID_COMMAND_SPECIFIER)
        super().block_upload(data)
