"""Vector's ASC, made from the frames of a run: `bus.asc`, or for a long run `bus-001.asc.gz`, ...

Every file has a head, a line for each frame with its time since the first frame of the run, and as
last line the SHA-256 of its frames' lines. The digest of the log is that of the one file that all
frames would make: it does not depend on where a part ends.
"""

from __future__ import annotations

import gzip
import hashlib
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime, tzinfo
from pathlib import Path
from typing import BinaryIO, cast

from stagectl.errors import UnusableInput, failure_to_write
from stagectl.store.atomic import create_anew
from stagectl.store.frame_spool import (
    FRAME,
    HEAD,
    find_parts,
    read_frames,
    read_head,
    remove_parts,
)

LOG_NAME = "bus.asc"
DIGEST_LINE = "// SHA-256 of the frames above: "
HEAD_END = "Start of measurement\n"
END = b"End TriggerBlock\n"
BUS_FAILED = 0x2000_0000
"""Id of a bus failure (SocketCAN's flag of error frames)."""

# Function codes (COB-ID & ~0x7F) that the host sends: NMT, RPDO 1..4, SDO request.
_HOST_SENDS = {0x000, 0x200, 0x300, 0x400, 0x500, 0x600}
_SYNC = 0x080
_HEARTBEAT = 0x700
_BLOCK = 4096  # frames converted at once
_LEVEL = 6  # of gzip


def log_part(path: Path, number: int) -> Path:
    """The file of a part, from 1, of the log that would be `path`."""
    return path.with_name(f"{path.stem}-{number:03}{path.suffix}.gz")


def find_log(path: Path) -> list[Path]:
    """The files of a log in order; none if there is no log.

    Raises:
        UnusableInput: a part is missing between others.
    """
    if path.exists():
        return [path]
    parts = [log_part(path, number) for number in range(1, len(_parts(path)) + 1)]
    for part in parts:
        if not part.exists():
            raise UnusableInput(f"{part}: no such file, and the log has later parts")
    return parts


def _parts(path: Path) -> list[Path]:
    name = re.compile(rf"{re.escape(path.stem)}-\d{{3,}}{re.escape(path.suffix)}\.gz")
    return [part for part in path.parent.glob("*.gz") if name.fullmatch(part.name)]


def convert_spool(spool: Path, path: Path, zone: tzinfo | None = None) -> str | None:
    """Convert a spool, whole or cut anywhere, to an ASC log and remove it.

    Args:
        spool: first part of a `FrameSpool`.
        path: of the log, replacing an existing one. More than one part: `log_part` of it instead.
        zone: of the date in the head.

    Returns:
        SHA-256 of the frames' lines; None where the spool was empty and there is no log.

    Raises:
        UnusableInput: a file is not a spool.
        StagectlError: the log cannot be written.
    """
    made: list[Path] = []
    try:
        parts = [part for part in find_parts(spool) if read_head(part) is not None]
        if not parts:  # killed before the first block was written
            remove_parts(spool)
            return None
        made = [log_part(path, n) for n in range(1, len(parts) + 1)] if parts[1:] else [path]
        digest = _convert(parts, made, zone)
        for old in {path, *_parts(path)}.difference(made):
            old.unlink(missing_ok=True)
        remove_parts(spool)
    except (EOFError, zlib.error) as damage:
        raise UnusableInput(f"{spool}: a compressed part of it is damaged: {damage}") from damage
    except OSError as error:
        for target in made:  # leaves the space to the recording
            with suppress(OSError):
                _unfinished(target).unlink(missing_ok=True)
                target.unlink(missing_ok=True)
        raise failure_to_write(f"{path}: cannot write", error) from error
    return digest


def _convert(parts: list[Path], targets: list[Path], zone: tzinfo | None) -> str:
    first = read_head(parts[0]) or b""
    _, started, host_node = HEAD.unpack(first)
    try:
        date = _date(datetime.fromtimestamp(started * 1e-6, zone))
    except (ValueError, OverflowError) as damage:
        raise UnusableInput(f"{parts[0]}: its header is damaged: {damage}") from damage
    lines, whole = _Lines(host_node), hashlib.sha256()
    for part, target in zip(parts, targets, strict=True):
        with _create(target) as file:
            seal = hashlib.sha256()
            file.write(_header(date))
            for frames in read_frames(part, _BLOCK):
                text = "".join(lines.format(frames)).encode("ascii")
                for digest in (seal, whole):
                    digest.update(text)
                file.write(text)
            seal.update(END)
            file.write(END + f"{DIGEST_LINE}{seal.hexdigest()}\n".encode("ascii"))
        _unfinished(target).replace(target)
    whole.update(END)
    return whole.hexdigest()


@contextmanager
def _create(target: Path) -> Iterator[BinaryIO]:
    """The unfinished file of a log, compressed where its name says so."""
    with create_anew(_unfinished(target)) as file:
        if target.suffix != ".gz":
            yield file
            return
        with gzip.GzipFile("", "wb", _LEVEL, file, 0) as packed:  # the same bytes at any time
            yield cast(BinaryIO, packed)


def _unfinished(target: Path) -> Path:
    return target.with_name(f"{target.name}.part")


def _header(date: str) -> bytes:
    """The head of the file, with the date."""
    return (
        f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
        f"Begin Triggerblock {date}\n   0.000000 {HEAD_END}"
    ).encode("ascii")


class _Lines:
    """Formats frames as lines, with times relative to the first."""

    def __init__(self, host_node: int) -> None:
        self._host_node = host_node
        self._ids: dict[int, str] = {}
        self._first: int | None = None

    def format(self, block: bytes) -> Iterator[str]:
        last, stamp = -1, ""
        for t_ns, can_id, length, data in FRAME.iter_unpack(block):
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
    milliseconds = time.microsecond // 1000
    return f"{time.ctime()[:7]} {time:%d %H:%M:%S}.{milliseconds:03} {time.year}"
