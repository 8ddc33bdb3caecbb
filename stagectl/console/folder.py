"""Files inside one folder, by names that a request has given.

Each part of a path is opened relative to the one before, without following links, so neither a name
nor a link that is exchanged meanwhile leads out of the folder.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import BinaryIO

_NAME = re.compile(r"[^./\\\x00-\x1f\x7f][^/\\\x00-\x1f\x7f]{0,199}")


class NoSuchFile(Exception):  # noqa: N818
    """There is no such file inside the folder."""


def is_name(name: str) -> bool:
    """Whether a text can be the name of a visible file or folder, and is no path."""
    return _NAME.fullmatch(name) is not None


def open_inside(folder: Path, *parts: str) -> BinaryIO:
    """A regular file inside a folder, open for reading.

    Args:
        folder: trusted; may be a link itself.
        parts: names of the folders in it, and of the file.

    Raises:
        NoSuchFile: a part is not a name, is a link, or not there.
    """
    if not parts or not all(is_name(part) for part in parts):
        raise NoSuchFile("not a file's name")
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK
    opened: list[int] = []
    try:
        opened.append(os.open(folder, flags | os.O_DIRECTORY))
        for k, part in enumerate(parts):
            kind = os.O_DIRECTORY if k < len(parts) - 1 else 0
            opened.append(os.open(part, flags | kind | os.O_NOFOLLOW, dir_fd=opened[-1]))
        if not stat.S_ISREG(os.fstat(opened[-1]).st_mode):
            raise NoSuchFile(f"{'/'.join(parts)}: not a file")
        return os.fdopen(opened.pop(), "rb")
    except (OSError, ValueError) as why:
        raise NoSuchFile(f"{'/'.join(parts)}: no such file") from why
    finally:
        for file in opened:
            os.close(file)
