"""Kinds of files that commands write, and how an existing file is told to be of one."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

_HEAD = 1 << 16
"""Bytes of a file that are looked at [B], JSON excepted."""
_FRAMES = re.compile(rb"date |LOGG|\(\d+\.\d+\) |timestamp,arbitration_id|;\$FILEVERSION")
"""How logs of frames begin: ASC, BLF, candump, CSV, TRC."""


@dataclass(frozen=True, slots=True)
class FileKind:
    """A kind of file.

    Attributes:
        name: with article: "a recipe".
        begins: whether a file with these first bytes and this path is of the kind.
    """

    name: str
    begins: Callable[[bytes, Path], bool]

    def is_at(self, path: Path) -> bool:
        """Whether an output of this kind may replace what is at a path without being asked to.

        Nothing, an empty file, a device or a pipe may be.
        """
        if not path.is_file():
            return True
        try:
            with path.open("rb") as file:
                head = file.read(_HEAD)
        except OSError:  # may be written and not read
            return False
        return not head.strip() or self.begins(head, path)


def _has_key(key: str) -> Callable[[bytes, Path], bool]:
    """Whether a YAML file has a key that only its kind has."""
    found = re.compile(rb"^[\"']?" + key.encode() + rb"[\"']?\s*:", re.MULTILINE)
    return lambda head, _: found.search(head) is not None


def _says(*texts: bytes) -> Callable[[bytes, Path], bool]:
    """Whether a page says that it was generated."""
    return lambda head, _: any(text in head for text in texts)


def _is_json(head: bytes, path: Path) -> bool:
    if head.lstrip()[:1] not in (b"{", b"["):
        return False
    try:
        json.loads(path.read_bytes())
    except (ValueError, OSError, RecursionError):
        return False
    return True


def _is_table(head: bytes, path: Path) -> bool:
    if path.suffix == ".parquet":
        return head.startswith(b"PAR1")
    return re.fullmatch(rb"\w+(,\w+)+", head.partition(b"\n")[0].strip()) is not None


ANY = FileKind("any file", lambda *_: True)
"""Whoever continues the file checks what it is."""
JSON = FileKind("a JSON file", _is_json)
HTML = FileKind("an HTML page", lambda head, _: head.lstrip().lower().startswith(b"<!doctype html"))
RECORDING = FileKind("a recording", lambda head, _: head.startswith(b"\x89HDF\r\n\x1a\n"))
MACHINE_FILE = FileKind("a machine file", _has_key("bus"))
RECIPE_FILE = FileKind("a recipe", _has_key("recipe"))
PROFILE = FileKind("a drive profile", _has_key("family"))
FRAME_LOG = FileKind("a log of frames", lambda head, _: _FRAMES.match(head) is not None)
TABLE = FileKind("a table", _is_table)
PAGE = FileKind("a generated page", _says(b"stagectl paper --out", b"stagectl gap blind"))
