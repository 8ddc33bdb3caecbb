"""A file is there as a whole or not at all, and an earlier one stays until then."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from stagectl.errors import StagectlError


def write_atomically(
    path: Path, content: str | bytes | memoryview, what: str, *, durable: bool = False
) -> None:
    """Write a file beside `path`, then put it in its place.

    Args:
        path: of the file; one that exists is replaced. Written to where it is a device or a pipe.
        content: text is written as UTF-8.
        what: it is, for the error: "report".
        durable: on the disk, not only with the system, before it takes its place.

    Raises:
        StagectlError: it cannot be written; names file, what it is and the system's reason.
    """
    part = path.with_name(path.name + ".part")
    if path.exists() and not path.is_file():
        part = path  # a device or a pipe takes it as it is; nothing may take its place
    try:
        with part.open("wb") as file:
            file.write(content.encode("utf-8") if isinstance(content, str) else content)
            if durable and part != path:
                file.flush()
                os.fsync(file.fileno())
        if part != path:
            part.replace(path)
    except OSError as error:
        if part != path:
            with suppress(OSError):  # whatever is in the way of the part file, too
                part.unlink()
        raise StagectlError(f"{path}: cannot write the {what}: {error.strerror}") from error
