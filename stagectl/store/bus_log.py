"""The bus log of a run: `bus.asc` in Vector's ASC, as read by python-can, asc2log and SavvyCAN.

It holds every classic CAN data frame with its time since the first one. Direction is the host's
view, derived from the CANopen function code (CiA 301, predefined connection set). Where the bus
refused to send or receive there is an `ErrorFrame`. The last line, a comment to other tools, is the
SHA-256 of the frames' lines, which is the same for every repetition of a run.

`tap` is called inside the SYNC cycle, so frames are spooled in binary to `bus.frames`; the text is
made at the end, or by `stagectl recover` after a kill. A frame reaches the log before the bus: if
the log cannot be written (disk full), it must not keep a quick stop from being sent, so it ends,
says so in `failure`, and keeps the frames it has.
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
from stagectl.errors import StagectlError, UnusableInput, failure_to_write
from stagectl.store.journal import FILE_NAME, locked_journal

LOG_NAME = "bus.asc"
SPOOL_SUFFIX = ".frames"
SPOOL_NAME = "bus.frames"
LEFT_OVER_NAME = "bus-recovered.asc"
DIGEST_LINE = "// SHA-256 of the frames above: "
HEAD_END = "Start of measurement\n"
BUS_FAILED = 0x2000_0000
"""Id of a bus failure (SocketCAN's flag of error frames)."""

# Function codes (COB-ID & ~0x7F) that the host sends: NMT, RPDO 1..4, SDO request.
_HOST_SENDS = {0x000, 0x200, 0x300, 0x400, 0x500, 0x600}
_SYNC = 0x080
_HEARTBEAT = 0x700
_HEAD = struct.Struct("<8sqB")  # magic, start of the run [us since 1970], host node
_MAGIC = b"stgspool"
_FRAME = struct.Struct("<qIB8s")  # time [ns], id, length, data
_BLOCK = 4096  # frames converted at once

_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class BusLog:
    """The bus log being written; the drivers call `tap` for every frame.

    As a context manager it never raises on exit: the run still has its recording to write.

    Attributes:
        path: of the ASC file, which exists after `close`.
        failure: why the log is incomplete, or None; the spool then stays, for `recover_log`.
        digest: SHA-256 of the frames' lines, after `close`; None where there is no ASC file.
    """

    def __init__(self, path: Path, started: datetime, host_node: int = HOST_NODE) -> None:
        """Create the spool; that of a killed run is converted to `bus-recovered.asc` first.

        Args:
            path: of the ASC file, replacing an existing one at the end.
            started: when the run began, for the header.
            host_node: node id of the host, to tell its heartbeats from received ones.

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
            raise failure_to_write(f"{self._spool}: cannot create", error) from error
        self._write = self._file.write
        self._pack = _FRAME.pack
        self._zone = started.tzinfo

    def tap(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Log one frame, sent or received.

        Args:
            t_ns: time on a monotonic clock [ns].
            can_id: arbitration id; an extended one above 0x7FF.
            data: up to 8 bytes.
        """
        if self.failure is None:
            try:
                self._write(self._pack(t_ns, can_id, len(data), data))
            except OSError as error:
                self.failure = f"{self._spool}: cannot write: {error.strerror}"

    def close(self) -> None:
        """Convert the spool to the ASC file; idempotent.

        Raises:
            StagectlError: it cannot be written, or frames are missing.
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
            self.digest = convert_spool(self._spool, self.path, self._zone)
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
        with suppress(StagectlError):  # `failure` says so
            self.close()


def _set_aside(spool: Path, zone: object) -> None:
    """Convert the spool of a killed run under another name; replace what is no spool."""
    if not spool.exists():
        return
    path, number = spool.with_name(LEFT_OVER_NAME), 1
    while path.exists():
        number += 1
        path = spool.with_name(LEFT_OVER_NAME.replace(".", f"-{number}."))
    with suppress(UnusableInput):
        convert_spool(spool, path, zone)


def recover_log(folder: Path) -> Path | None:
    """Convert the spool that a killed run left in a folder.

    Returns:
        Path of the ASC file; None where there was no spool, or nothing in it.

    Raises:
        UnusableInput: the file is not a spool.
        StagectlError: the run is still in progress, or the ASC file cannot be written.
    """
    journal = folder / FILE_NAME
    # The journal, and its lock, last as long as the spool.
    with locked_journal(journal) if journal.exists() else nullcontext():
        return _recover_log(folder)


def _recover_log(folder: Path) -> Path | None:
    path = folder / LOG_NAME
    spool = path.with_suffix(SPOOL_SUFFIX)
    if not spool.exists():
        return None
    zone = datetime.now().astimezone().tzinfo
    return None if convert_spool(spool, path, zone) is None else path


def convert_spool(spool: Path, path: Path, zone: object = None) -> str | None:
    """Convert a spool, whole or cut anywhere, to an ASC file and remove it.

    Args:
        spool: file of a `BusLog`.
        path: of the ASC file, replacing an existing one.
        zone: tzinfo of the date in its header.

    Returns:
        SHA-256 of the frames' lines, as stated in the last line; None where the spool was empty and
        there is no file.

    Raises:
        UnusableInput: the file is not a spool.
        StagectlError: the ASC file cannot be written.
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
                for text_block in _body(frames, host_node):
                    seal.update(text_block)
                    text.write(text_block)
                digest = seal.hexdigest()
                text.write(f"{DIGEST_LINE}{digest}\n".encode("ascii"))
        part.replace(path)
        spool.unlink()
        return digest
    except OSError as error:
        with suppress(OSError):  # leaves the space to the recording
            part.unlink()
        raise failure_to_write(f"{path}: cannot write", error) from error


def _header(date: str) -> bytes:
    """The head of the file, with the date."""
    return (
        f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
        f"Begin Triggerblock {date}\n   0.000000 {HEAD_END}"
    ).encode("ascii")


def _body(frames: BinaryIO, host_node: int) -> Iterator[bytes]:
    """The text between head and digest, block by block."""
    lines = _Lines(host_node)
    while block := frames.read(_FRAME.size * _BLOCK):
        text = "".join(lines.format(block[: len(block) // _FRAME.size * _FRAME.size]))
        yield text.encode("ascii")
    yield b"End TriggerBlock\n"


class _Lines:
    """Formats frames as lines, with times relative to the first."""

    def __init__(self, host_node: int) -> None:
        self._host_node = host_node
        self._ids: dict[int, str] = {}
        self._first: int | None = None

    def format(self, block: bytes) -> Iterator[str]:
        last, stamp = -1, ""
        for t_ns, can_id, length, data in _FRAME.iter_unpack(block):
            if t_ns != last:  # all frames of a lock-step cycle have the same time
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
    """In Vector's form, whatever the locale: Mon Nov 02 08:00:00.000 2026."""
    return (
        f"{_DAYS[time.weekday()]} {_MONTHS[time.month - 1]} {time.day:02} "
        f"{time:%H:%M:%S}.{time.microsecond // 1000:03} {time.year}"
    )
