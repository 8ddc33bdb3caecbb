"""Writes a file completely or not at all; an earlier one stays until then."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from stagectl.errors import failure_to_write


def create_anew(path: Path, buffering: int = -1) -> BinaryIO:
    """Create a file for writing in place of what is there; a link is replaced, never followed.

    Raises:
        OSError: it cannot be created, or somebody else created it at the same time.
    """
    path.unlink(missing_ok=True)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    return os.fdopen(os.open(path, flags, 0o666), "wb", buffering)


def write_atomically(
    path: Path, content: str | bytes | memoryview, what: str, *, durable: bool = False
) -> None:
    """Write a file beside `path`, then rename it.

    Args:
        path: of the file, replacing an existing one; a device or a pipe is written to directly.
        content: text is written as UTF-8.
        what: kind of file, for the error: "report".
        durable: flush to the disk before renaming.

    Raises:
        StagectlError: it cannot be written; names the file, its kind and the system's reason.
    """
    part = path.with_name(path.name + ".part")
    if path.exists() and not path.is_file():
        part = path  # a device or a pipe must not be replaced
    try:
        with part.open("wb") if part == path else create_anew(part) as file:
            file.write(content.encode("utf-8") if isinstance(content, str) else content)
            if durable and part != path:
                file.flush()
                os.fsync(file.fileno())
        if part != path:
            part.replace(path)
    except OSError as error:
        if part != path:
            with suppress(OSError):  # it may not exist, or not be ours to remove
                part.unlink()
        raise failure_to_write(f"{path}: cannot write the {what}", error) from error
