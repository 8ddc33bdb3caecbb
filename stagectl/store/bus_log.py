"""The bus log of a run: `bus.asc`, Vector's ASC, as python-can, asc2log and SavvyCAN read it.

Every data frame with its time since the first, classic CAN only (no CAN FD, no remote frames).
Direction is the host's view, told by the CANopen function code (CiA 301, predefined connection
set). Python-can's own writer takes 5 us a frame; this one has to keep up with 100,000 a second.
Lines are buffered: a killed process loses the last few thousand frames of this log, never samples.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from types import TracebackType

from stagectl.errors import StagectlError

# Function codes (COB-ID & ~0x7F) the host sends: NMT, SYNC (node 0), RPDO 1..4, SDO request.
_HOST_SENDS = {0x000, 0x200, 0x300, 0x400, 0x500, 0x600}
_SYNC = 0x080
_HEARTBEAT = 0x700
_FLUSH_LINES = 4096

_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class BusLog:
    """Writes frames to an ASC file; `tap` is what the drivers call for each.

    Attributes:
        path: of the file.
    """

    def __init__(self, path: Path, started: datetime, host_node: int = 127) -> None:
        """Create the file and write its header.

        Args:
            path: an existing file is replaced.
            started: when the run began; only the header shows it.
            host_node: node id of the host, whose heartbeats are sent, not received.

        Raises:
            StagectlError: it cannot be written.
        """
        self.path = path
        self._host_node = host_node
        self._lines: list[str] = []
        self._ids: dict[int, str] = {}
        self._first: int | None = None
        self._last = -1
        self._stamp = ""
        try:
            self._file = path.open("wb", buffering=0)  # the lines are the buffer
        except OSError as error:
            raise StagectlError(f"{path}: cannot create: {error.strerror}") from error
        date = _date(started)
        self._lines.append(
            f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
            f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
        )

    def tap(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Log one frame, sent or received.

        Args:
            t_ns: time on any clock that does not run backwards [ns].
            can_id: arbitration id; above 0x7FF it is logged as extended.
            data: up to 8 bytes.

        Raises:
            StagectlError: it cannot be written (disk full).
        """
        if t_ns != self._last:  # all frames of a lock-step cycle have one time
            if self._first is None:
                self._first = t_ns
            self._last = t_ns
            self._stamp = "%11.6f" % (max(t_ns - self._first, 0) * 1e-9)
        identity = self._ids.get(can_id)
        if identity is None:
            identity = self._identity(can_id)
        lines = self._lines
        lines.append(f"{self._stamp}{identity}{len(data)} {data.hex(' ').upper()}\n")
        if len(lines) >= _FLUSH_LINES:
            self._flush()

    def close(self) -> None:
        """Write what is buffered and close; idempotent.

        Raises:
            StagectlError: it cannot be written.
        """
        if not self._file.closed:
            self._lines.append("End TriggerBlock\n")
            try:
                self._flush()
            finally:
                self._file.close()

    def __enter__(self) -> BusLog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _identity(self, can_id: int) -> str:
        function, node = can_id & 0x780, can_id & 0x7F
        sent = (
            function in _HOST_SENDS
            or can_id == _SYNC
            or (function == _HEARTBEAT and node == self._host_node)
        )
        name = f"{can_id:X}" if can_id <= 0x7FF else f"{can_id:X}x"
        text = f" 1  {name:<15} {'Tx' if sent else 'Rx':<4} d "
        self._ids[can_id] = text
        return text

    def _flush(self) -> None:
        data = "".join(self._lines).encode("ascii")
        self._lines.clear()
        try:
            complete = self._file.write(data) == len(data)
        except OSError as error:
            raise StagectlError(f"{self.path}: cannot write: {error.strerror}") from error
        if not complete:
            raise StagectlError(f"{self.path}: cannot write: the disk is full")


def _date(time: datetime) -> str:
    """As Vector writes it, whatever the locale: Mon Nov 02 08:00:00.000 2026."""
    return (
        f"{_DAYS[time.weekday()]} {_MONTHS[time.month - 1]} {time.day:02} "
        f"{time:%H:%M:%S}.{time.microsecond // 1000:03} {time.year}"
    )
