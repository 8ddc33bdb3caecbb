"""The bus log of a run: `bus.asc`, Vector's ASC, as python-can, asc2log and SavvyCAN read it.

Every data frame with its time since the first, classic CAN only (no CAN FD, no remote frames).
Direction is the host's view, told by the CANopen function code (CiA 301, predefined connection
set). While the run goes on frames are spooled as they are to `bus.frames` beside it, for `tap` is
called inside the SYNC cycle; the text is made at the end, or by `recover` where a run was killed.
Its last line, a comment to other tools, is the SHA-256 of the lines between its head and this one:
the same run has the same, whenever it was. Where the bus failed the host there is an `ErrorFrame`.

The log is the least of what a run writes, and it sees every frame before the bus does: where it
cannot be written (disk full) it must not keep a quick stop from being sent, so it ends there, says
so in `failure`, and leaves the frames it has.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from drivers.settings import HOST_NODE
from stagectl.errors import StagectlError, UnusableInput
from stagectl.store.journal import FILE_NAME, claimed

LOG_NAME = "bus.asc"
SPOOL_SUFFIX = ".frames"
SPOOL_NAME = "bus.frames"
LEFT_OVER_NAME = "bus-recovered.asc"
DIGEST_LINE = "// SHA-256 of the frames above: "
HEAD_END = "Start of measurement\n"
BUS_FAILED = 0x2000_0000
"""In place of an id: the bus refused to send or receive (SocketCAN's flag of error frames)."""

# Function codes (COB-ID & ~0x7F) the host sends: NMT, SYNC (node 0), RPDO 1..4, SDO request.
_HOST_SENDS = {0x000, 0x200, 0x300, 0x400, 0x500, 0x600}
_SYNC = 0x080
_HEARTBEAT = 0x700
_HEAD = struct.Struct("<8sqB")  # magic, start of the run [us since 1970], host node
_MAGIC = b"stgspool"
_FRAME = struct.Struct("<qIB8s")  # time [ns], id, length, data
_BLOCK = 4096  # frames made into text at once

_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class BusLog:
    """Takes frames while a run goes on; `tap` is what the drivers call for each.

    As a context it never raises at its end: whoever runs has a recording to write yet.

    Attributes:
        path: of the ASC file, there after `close`.
        failure: why the log is not whole, or None; the spool stays then, for `recover`.
        digest: SHA-256 of the ASC file's frames, after `close`; None where there is none.
    """

    def __init__(self, path: Path, started: datetime, host_node: int = HOST_NODE) -> None:
        """Create the spool file; one that a killed run left becomes `bus-recovered.asc` before.

        Args:
            path: an existing file is replaced at the end.
            started: when the run began; only the header shows it.
            host_node: node id of the host, whose heartbeats are sent, not received.

        Raises:
            StagectlError: it cannot be written.
        """
        self.path = path
        self.failure: str | None = None
        self.digest: str | None = None
        self._spool = path.with_suffix(SPOOL_SUFFIX)
        _set_aside(self._spool, started.tzinfo)
        try:
            self._file = self._spool.open("wb", buffering=1 << 16)
            self._file.write(_HEAD.pack(_MAGIC, round(started.timestamp() * 1e6), host_node))
        except OSError as error:
            raise StagectlError(f"{self._spool}: cannot create: {error.strerror}") from error
        self._write = self._file.write
        self._pack = _FRAME.pack
        self._zone = started.tzinfo

    def tap(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Log one frame, sent or received.

        Args:
            t_ns: time on any clock that does not run backwards [ns].
            can_id: arbitration id; above 0x7FF it is logged as extended.
            data: up to 8 bytes.
        """
        if self.failure is None:
            try:
                self._write(self._pack(t_ns, can_id, len(data), data))
            except OSError as error:
                self.failure = f"{self._spool}: cannot write: {error.strerror}"

    def close(self) -> None:
        """Make the ASC file out of the spool; idempotent.

        Raises:
            StagectlError: it cannot be written, or frames are missing in it.
        """
        if self._file.closed:
            return
        try:
            self._file.close()
        except OSError as error:
            self.failure = self.failure or f"{self._spool}: cannot write: {error.strerror}"
        if self.failure is not None:
            raise StagectlError(self.failure)
        try:
            self.digest = convert(self._spool, self.path, self._zone)
        except StagectlError as error:
            self.failure = str(error)
            raise

    def __enter__(self) -> BusLog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with suppress(StagectlError):  # it is in `failure`
            self.close()


def _set_aside(spool: Path, zone: object) -> None:
    """What a killed run left is made into a log of another name; what is no spool goes."""
    if not spool.exists():
        return
    path, number = spool.with_name(LEFT_OVER_NAME), 1
    while path.exists():
        number += 1
        path = spool.with_name(LEFT_OVER_NAME.replace(".", f"-{number}."))
    with suppress(UnusableInput):
        convert(spool, path, zone)


def recover_log(folder: Path) -> Path | None:
    """Make the ASC file out of the spool that a killed run left in a folder.

    Returns:
        The file, or None where there was no spool, or nothing in it yet.

    Raises:
        UnusableInput: the spool is not one.
        StagectlError: the run still goes on, or the file cannot be written.
    """
    journal = folder / FILE_NAME
    # a run has its journal, and the journal's lock, for as long as it has its spool
    with claimed(journal) if journal.exists() else nullcontext():
        return _recover_log(folder)


def _recover_log(folder: Path) -> Path | None:
    path = folder / LOG_NAME
    spool = path.with_suffix(SPOOL_SUFFIX)
    if not spool.exists():
        return None
    zone = datetime.now().astimezone().tzinfo
    return None if convert(spool, path, zone) is None else path


def convert(spool: Path, path: Path, zone: object = None) -> str | None:
    """Make an ASC file out of a spool, whole or cut anywhere, and remove the spool.

    Args:
        spool: file of a `BusLog`.
        path: to write; an existing file is replaced.
        zone: tzinfo of the date in its header.

    Returns:
        SHA-256 of the frames' lines, as its last line states it; None where there was nothing in
        the spool and so there is no file.

    Raises:
        UnusableInput: it is not a spool.
        StagectlError: the file cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        with spool.open("rb") as frames:
            head = frames.read(_HEAD.size)
            if len(head) < _HEAD.size and _MAGIC.startswith(head[: len(_MAGIC)]):
                spool.unlink()  # killed before the first block was written
                return None
            if len(head) < _HEAD.size or not head.startswith(_MAGIC):
                raise UnusableInput(f"{spool}: not the frames of a bus log")
            _, started, host_node = _HEAD.unpack(head)
            try:
                date = _date(datetime.fromtimestamp(started * 1e-6, zone))  # type: ignore[arg-type]
            except (ValueError, OverflowError) as damage:
                raise UnusableInput(f"{spool}: its header is damaged: {damage}") from damage
            with part.open("wb") as text:
                seal = hashlib.sha256()
                text.write(_header(date))
                for piece in _pieces(frames, host_node):
                    seal.update(piece)
                    text.write(piece)
                digest = seal.hexdigest()
                text.write(f"{DIGEST_LINE}{digest}\n".encode("ascii"))
        part.replace(path)
        spool.unlink()
        return digest
    except OSError as error:
        with suppress(OSError):  # leaves its room to the recording
            part.unlink()
        raise StagectlError(f"{path}: cannot write: {error.strerror}") from error


def _header(date: str) -> bytes:
    """The file's head, in which the date stands."""
    return (
        f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
        f"Begin Triggerblock {date}\n   0.000000 {HEAD_END}"
    ).encode("ascii")


def _pieces(frames: BinaryIO, host_node: int) -> Iterator[bytes]:
    """The file's text between head and digest."""
    lines = _Lines(host_node)
    while block := frames.read(_FRAME.size * _BLOCK):
        text = "".join(lines.of(block[: len(block) // _FRAME.size * _FRAME.size]))
        yield text.encode("ascii")
    yield b"End TriggerBlock\n"


class _Lines:
    """Frames as lines of text, their times relative to the first."""

    def __init__(self, host_node: int) -> None:
        self._host_node = host_node
        self._ids: dict[int, str] = {}
        self._first: int | None = None

    def of(self, block: bytes) -> Iterator[str]:
        last, stamp = -1, ""
        for t_ns, can_id, length, data in _FRAME.iter_unpack(block):
            if t_ns != last:  # all frames of a lock-step cycle have one time
                if self._first is None:
                    self._first = t_ns
                last = t_ns
                stamp = "%11.6f" % (max(t_ns - self._first, 0) * 1e-9)
            if can_id == BUS_FAILED:
                yield f"{stamp} 1  ErrorFrame\n"
                continue
            identity = self._ids.get(can_id) or self._identity(can_id)
            yield f"{stamp}{identity}{length} {data[:length].hex(' ').upper()}\n"

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


def _date(time: datetime) -> str:
    """As Vector writes it, whatever the locale: Mon Nov 02 08:00:00.000 2026."""
    return (
        f"{_DAYS[time.weekday()]} {_MONTHS[time.month - 1]} {time.day:02} "
        f"{time:%H:%M:%S}.{time.microsecond // 1000:03} {time.year}"
    )
