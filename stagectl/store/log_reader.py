"""Reads the bus log of a run, `bus.asc` or its compressed parts, and computes its digest."""

from __future__ import annotations

import gzip
import hashlib
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from stagectl.errors import UnusableInput
from stagectl.store.asc_log import DIGEST_LINE, END, HEAD_END, find_log

MAX_FRAMES = 50_000_000

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
    """A whole log.

    Attributes:
        frames: in order.
        digest: SHA-256 of the frames' lines, in hex; of all parts, as if they were one file.
        stated: digest that the log states, or None; where a part states another one than its own,
            the one that this part states.
    """

    frames: tuple[LoggedFrame, ...]
    digest: str
    stated: str | None


def read_log(path: Path) -> LoggedBus:
    """Read a log written by `bus_log`.

    Args:
        path: of `bus.asc`, also where its parts are there instead.

    Raises:
        UnusableInput: there is none, a part is missing, or a line has another form; names the line.
    """
    files = find_log(path) or [path]
    frames: list[LoggedFrame] = []
    whole, wrong, complete = hashlib.sha256(), None, True
    for file in files:
        body, mark, stated = _read_text(file).partition(DIGEST_LINE)
        frames.extend(_frames(body, file, frames[-1].time_ns if frames else 0))
        lines = body.partition(HEAD_END)[2].encode("ascii")
        whole.update(lines if file is files[-1] else lines.removesuffix(END))
        complete = complete and bool(mark)
        if mark and stated.strip() != hashlib.sha256(lines).hexdigest():
            wrong = wrong or stated.strip()
    digest = whole.hexdigest()
    return LoggedBus(tuple(frames), digest, (wrong or digest) if complete else None)


def _read_text(file: Path) -> str:
    try:
        data = file.read_bytes()
        text = gzip.decompress(data) if file.suffix == ".gz" else data
        return text.decode("ascii").replace("\r\n", "\n")
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise UnusableInput(f"{file}: {reason or 'not a bus log'}") from error


def _frames(text: str, path: Path, last: int) -> Iterator[LoggedFrame]:
    for number, line in enumerate(text.split("\n"), 1):
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
