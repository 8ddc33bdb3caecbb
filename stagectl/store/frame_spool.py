"""Frames on disk during a run: binary, appended in the SYNC cycle, in parts.

The first part is `bus.frames`. After PART_FRAMES frames the next one (`bus-002.frames`, ...) takes
over, and a thread compresses the full one (`bus.frames.gz`, ...). zlib works without Python's lock,
so the thread does not hold up the SYNC cycle; it also opens the next file beforehand. A part is
handed to the kernel before the next one begins, so that a killed process loses only the last
frames, as with a single file.
"""

from __future__ import annotations

import gzip
import os
import shutil
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import BinaryIO, cast

from stagectl.errors import UnusableInput, failure_to_write
from stagectl.store.atomic import create_anew

PART_FRAMES = 1 << 21
"""Frames in a part: about 7 minutes of two axes at 1 kHz, 44 MB."""
HEAD = struct.Struct("<8sqB")
"""Head of each part: magic, start of the run [us since 1970], host node."""
FRAME = struct.Struct("<qIB8s")
"""A frame: time [ns], id, length, data."""
MAGIC = b"stgspool"
_AHEAD = 4096  # frames before the end of a part at which the next one is opened
_BLOCK = 1 << 20  # bytes compressed at once


class FrameSpool:
    """The parts being written.

    Args:
        path: of the first part.
        head: of every part.
        part_frames: number of frames in a part.

    Raises:
        StagectlError: it cannot be created.
    """

    def __init__(self, path: Path, head: bytes, part_frames: int = PART_FRAMES) -> None:
        self._path, self._head, self._part_frames = path, head, part_frames
        try:
            self._file = self._open(path)
        except OSError as error:
            raise failure_to_write(f"{path}: cannot create", error) from error
        self._number = 1
        self._next: BinaryIO | None = None
        self._ahead = min(_AHEAD, part_frames // 2)
        self._left = part_frames - self._ahead
        self._write, self._pack = self._file.write, FRAME.pack
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="bus log", daemon=True)
        self._thread.start()

    def append(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Append one frame; never waits for the thread.

        Raises:
            OSError: it cannot be written.
        """
        self._write(self._pack(t_ns, can_id, len(data), data))
        self._left -= 1
        if self._left <= 0:
            self._turn()

    def close(self) -> None:
        """Hand over everything and wait for the thread; idempotent.

        Raises:
            OSError: it cannot be written.
        """
        if self._file.closed:
            return
        self._jobs.put(None)
        self._thread.join()
        if self._next is not None:
            self._next.close()
            part_path(self._path, self._number + 1).unlink()
        self._file.close()

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._file.closed

    def _turn(self) -> None:
        """Continue in the next part, or see to it that there is one."""
        following = self._next
        if following is None:
            self._jobs.put(self._open_next)
            self._left = self._ahead
            return
        self._file.flush()
        full, self._file, self._next = self._file, following, None
        self._write = following.write
        self._jobs.put(partial(_compress, full, part_path(self._path, self._number)))
        self._number += 1
        self._left = self._part_frames - self._ahead

    def _open(self, path: Path) -> BinaryIO:
        file = create_anew(path, 1 << 16)
        file.write(self._head)
        return file

    def _open_next(self) -> None:
        if self._next is None:  # else it was asked for twice
            self._next = self._open(part_path(self._path, self._number + 1))

    def _work(self) -> None:
        with suppress(OSError):  # not on every system
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)
        while (job := self._jobs.get()) is not None:
            with suppress(OSError):  # such as a full disk: the part stays as it is
                job()


def part_path(path: Path, number: int) -> Path:
    """The file of a part, from 1."""
    return path if number == 1 else path.with_name(f"{path.stem}-{number:03}{path.suffix}")


def find_parts(path: Path) -> list[Path]:
    """The files of a spool in order, whole or compressed; none if there is no spool."""
    found: list[Path] = []
    while True:
        part = part_path(path, len(found) + 1)
        packed = _packed(part)
        if not part.exists() and not packed.exists():
            return found
        # A part that was being removed after its compression is there twice.
        found.append(packed if packed.exists() else part)


def remove_parts(path: Path) -> None:
    """Remove a spool; the last part first, so that the rest remains one if it is interrupted."""
    for number in range(len(find_parts(path)), 0, -1):
        part = part_path(path, number)
        part.unlink(missing_ok=True)
        _packed(part).unlink(missing_ok=True)


def read_head(part: Path) -> bytes | None:
    """The head of a part; None where it was killed before the head was written.

    Raises:
        UnusableInput: it is not a part of a spool.
        OSError: it cannot be read.
    """
    with open_packed(part) as file:
        head = file.read(HEAD.size)
    if len(head) < HEAD.size and MAGIC.startswith(head[: len(MAGIC)]):
        return None
    if len(head) < HEAD.size or not head.startswith(MAGIC):
        raise UnusableInput(f"{part}: not the frames of a bus log")
    return head


def read_frames(part: Path, count: int) -> Iterator[bytes]:
    """Blocks of up to `count` whole frames of a part.

    Raises:
        OSError: it cannot be read.
    """
    with open_packed(part) as file:
        file.read(HEAD.size)
        while block := file.read(FRAME.size * count):
            yield block[: len(block) // FRAME.size * FRAME.size]


def open_packed(part: Path) -> BinaryIO:
    """A file to be read, whole or compressed."""
    return cast(BinaryIO, gzip.open(part)) if part.suffix == ".gz" else part.open("rb")


def _packed(part: Path) -> Path:
    return part.with_name(f"{part.name}.gz")


def _compress(full: BinaryIO, part: Path) -> None:
    full.close()
    target = _packed(part)
    making = target.with_name(f"{target.name}.part")
    try:
        with part.open("rb") as frames, create_anew(making) as file:
            with gzip.GzipFile("", "wb", 1, file, 0) as packed:
                shutil.copyfileobj(frames, packed, _BLOCK)
        making.replace(target)
        part.unlink()
    except OSError:
        making.unlink(missing_ok=True)
        raise
