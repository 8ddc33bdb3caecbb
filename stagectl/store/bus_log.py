"""The bus log of a run: `bus.asc` in Vector's ASC, as read by python-can, asc2log and SavvyCAN.

It holds every classic CAN data frame with its time since the first one. Direction is the host's
view, derived from the CANopen function code (CiA 301, predefined connection set). Where the bus
refused to send or receive there is an `ErrorFrame`. The last line, a comment to other tools, is the
SHA-256 of the frames' lines, which is the same for every repetition of a run. The log of a long run
is kept in compressed parts (`asc_log`).

`tap` is called inside the SYNC cycle, so frames are spooled in binary (`frame_spool`); the text is
made at the end, or by `stagectl recover` after a kill. A frame reaches the log before the bus: if
the log cannot be written (disk full), it must not keep a quick stop from being sent, so it ends,
says so in `failure`, and keeps the frames it has.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext, suppress
from datetime import datetime, tzinfo
from pathlib import Path

from drivers.settings import HOST_NODE
from stagectl.errors import StagectlError, UnusableInput
from stagectl.store.asc_log import LOG_NAME, convert_spool, find_log
from stagectl.store.frame_spool import HEAD, MAGIC, PART_FRAMES, FrameSpool, find_parts
from stagectl.store.journal import FILE_NAME, locked_journal

SPOOL_SUFFIX = ".frames"
SPOOL_NAME = "bus.frames"
LEFT_OVER_NAME = "bus-recovered.asc"


class BusLog(AbstractContextManager["BusLog"]):
    """The bus log being written; the drivers hand every frame to it.

    Its end never raises: the run still has its recording to write.

    Attributes:
        path: of the ASC file, which exists after `close`; for a long run `asc_log.log_part` of it.
        failure: why the log is incomplete, or None; the spool then stays, for `recover_log`.
        digest: SHA-256 of the frames' lines, after `close`; None where there is no ASC file.
    """

    def __init__(self, path: Path, started: datetime, part_frames: int = PART_FRAMES) -> None:
        """Create the spool; that of a killed run is converted to `bus-recovered.asc` first.

        Args:
            path: of the ASC file, replacing an existing one at the end.
            started: when the run began, for the header.
            part_frames: frames per compressed part of a longer log.

        Raises:
            StagectlError: it cannot be written.
        """
        self.path = path
        self.failure: str | None = None
        self.digest: str | None = None
        self._spool = path.with_suffix(SPOOL_SUFFIX)
        _set_aside(self._spool, started.tzinfo)
        head = HEAD.pack(MAGIC, round(started.timestamp() * 1e6), HOST_NODE)
        self._frames = FrameSpool(self._spool, head, part_frames)
        self._append = self._frames.append
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
                self._append(t_ns, can_id, data)
            except OSError as error:
                self.failure = f"{self._spool}: cannot write: {error.strerror}"

    __call__ = tap

    def close(self) -> None:
        """Convert the spool to the ASC log; idempotent. Where it cannot, `failure` says why."""
        if self._frames.closed:
            return
        try:
            self._frames.close()
            if self.failure is None:
                self.digest = convert_spool(self._spool, self.path, self._zone)
        except OSError as error:
            self.failure = self.failure or f"{self._spool}: cannot write: {error.strerror}"
        except StagectlError as error:
            self.failure = str(error)

    def leave(self) -> None:
        """Close the spool and leave it for `recover_log`; errors as of `close`."""
        try:
            self._frames.close()
        except OSError as error:
            self.failure = self.failure or f"{self._spool}: cannot write: {error.strerror}"

    def __exit__(self, *_: object) -> None:
        self.close()


def _set_aside(spool: Path, zone: tzinfo | None) -> None:
    """Convert the spool of a killed run under another name; replace what is no spool."""
    if not find_parts(spool):
        return
    path, number = spool.with_name(LEFT_OVER_NAME), 1
    while find_log(path):
        number += 1
        path = spool.with_name(LEFT_OVER_NAME.replace(".", f"-{number}."))
    with suppress(UnusableInput):
        convert_spool(spool, path, zone)


def recover_log(folder: Path) -> Path | None:
    """Convert the spool that a killed run left in a folder.

    Returns:
        Path of the ASC file, the first one of several; None where there was no spool, or nothing
        in it.

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
    if not find_parts(spool):
        return None
    zone = datetime.now().astimezone().tzinfo
    return None if convert_spool(spool, path, zone) is None else find_log(path)[0]
