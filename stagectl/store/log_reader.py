"""Reads the bus log of a run, `bus.asc` or its compressed parts, and computes its digest."""

from __future__ import annotations

import hashlib
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from stagectl.errors import UnusableInput
from stagectl.store.asc_log import DIGEST_LINE, END, HEAD_END, find_log
from stagectl.store.frame_spool import open_packed

_DIGEST, _HEAD_END = DIGEST_LINE.encode(), HEAD_END.encode()
_LINE = re.compile(
    r" *(\d{1,12})\.(\d{6}) +1 +"
    r"(?:(?P<error>ErrorFrame)|(?P<id>[0-9A-F]{1,8})(?P<extended>x?) +(?P<way>Tx|Rx) +d +"
    r"(?P<length>[0-8])(?P<data>(?: +[0-9A-F]{2})*)) *",
    re.ASCII,
)
_HEADER = ("date ", "base hex ", "internal events ", "Begin Triggerblock", "End TriggerBlock", "//")


@dataclass(frozen=True, slots=True)
class LoggedFrame:
    """One line of the log.

    Attributes:
        time_ns: since the first frame [ns], in whole microseconds, never decreasing.
        sent: by the host.
        can_id: arbitration id; -1 for a bus failure.
        data: up to 8 bytes.
    """

    time_ns: int
    sent: bool
    can_id: int
    data: bytes

    @property
    def failed(self) -> bool:
        """Whether the bus refused to send or receive."""
        return self.can_id < 0


@dataclass(frozen=True, slots=True)
class LoggedBus:
    """A whole log, of which one line at a time is in memory.

    Attributes:
        files: of the log, in order.
        count: number of frames.
        digest: SHA-256 of the frames' lines, in hex; of all parts, as if they were one file.
        stated: digest written in the log, or None; if a part contains a wrong digest of its own,
            that wrong one.
    """

    files: tuple[Path, ...]
    count: int
    digest: str
    stated: str | None

    def frames(self) -> Iterator[LoggedFrame]:
        """All frames in order, read as they are taken.

        Raises:
            UnusableInput: as `read_log`; or after the last frame, if the log has changed since.
        """
        last, count, whole = 0, 0, hashlib.sha256()
        for file in self.files:
            lines = _Part(file).lines(whole.update, file is self.files[-1])
            for frame in _frames(lines, file, last):
                last = frame.time_ns
                count += 1
                yield frame
        if (count, whole.hexdigest()) != (self.count, self.digest):
            raise UnusableInput(f"{self.files[0]}: has changed since it was checked")


def read_log(path: Path) -> LoggedBus:
    """Check a log written by `bus_log` from end to end, and compute its digest.

    Args:
        path: of `bus.asc`, even if the log is stored in parts instead.

    Raises:
        UnusableInput: there is none, a part is missing, or a line has another form; names the line.
    """
    files = find_log(path) or [path]
    whole, wrong, complete, count, last = hashlib.sha256(), None, True, 0, 0
    for file in files:
        part = _Part(file)
        for frame in _frames(part.lines(whole.update, file is files[-1]), file, last):
            last = frame.time_ns
            count += 1
        complete = complete and part.stated is not None
        if part.stated is not None and part.stated != part.digest:
            wrong = wrong or part.stated
    digest = whole.hexdigest()
    return LoggedBus(tuple(files), count, digest, (wrong or digest) if complete else None)


class _Part:
    """One file of a log.

    Attributes:
        digest: of its frames' lines; known once all lines were taken.
        stated: digest that the file states, or None; likewise.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.digest = ""
        self.stated: str | None = None

    def lines(self, whole: Callable[[bytes], object], is_last: bool) -> Iterator[str]:
        """The lines up to the digest; those of the frames also go into the digest of the log.

        Raises:
            UnusableInput: the file cannot be read.
        """
        own, held, in_frames = hashlib.sha256(), b"", False
        try:
            with open_packed(self.file) as stream:
                for raw in stream:
                    line, mark, stated = raw.replace(b"\r\n", b"\n").partition(_DIGEST)
                    if in_frames and line:
                        whole(held)
                        own.update(line)
                        held = line
                    in_frames = in_frames or line.endswith(_HEAD_END)
                    yield line.decode("ascii").removesuffix("\n")
                    if mark:
                        rest = sum(bool(more.strip()) for more in stream)  # checks gzip's CRC, too
                        self.stated = stated.decode("ascii").strip() + (" ..." if rest else "")
                        break
        except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else None
            raise UnusableInput(f"{self.file}: {reason or 'not a bus log'}") from error
        whole(held if is_last else held.removesuffix(END))
        self.digest = own.hexdigest()


def _frames(lines: Iterable[str], path: Path, last: int) -> Iterator[LoggedFrame]:
    for number, line in enumerate(lines, 1):
        if not line.strip(" ") or line.startswith(_HEADER) or line.endswith("Start of measurement"):
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise UnusableInput(f"{path}:{number}: not a frame of a bus log: {line.strip()[:60]!r}")
        time_ns = int(match[1]) * 1_000_000_000 + int(match[2]) * 1000
        # In real time a frame may carry the time at which its cycle began.
        last = time_ns = max(time_ns, last)
        if match["error"]:
            yield LoggedFrame(time_ns, False, -1, b"")
            continue
        data = bytes.fromhex(match["data"])
        if len(data) != int(match["length"]):
            raise UnusableInput(f"{path}:{number}: states {match['length']} bytes, has {len(data)}")
        yield LoggedFrame(time_ns, match["way"] == "Tx", int(match["id"], 16), data)
