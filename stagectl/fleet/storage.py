"""Where recordings and results are: folders of this machine, or any file system that fsspec knows.

Recordings are only listed here; workers read them (`local_copy`).
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fsspec.core import url_to_fs

from stagectl.errors import UnusableInput
from stagectl.plain_text import one_line
from stagectl.store import write_atomically

SUFFIXES = (".h5", ".hdf5")
"""Of recordings in folders."""
_LOCAL = "file"
_CHANGES = ("ETag", "mtime", "LastModified", "last_modified", "updated")
"""What file systems say of a file's version, the surest first."""


@dataclass(frozen=True, slots=True)
class Source:
    """A recording as listed.

    Attributes:
        url: an absolute path, or an address with protocol.
        stamp: its size and version; "" where the file system states no version.
    """

    url: str
    stamp: str


def find_recordings(texts: Iterable[str]) -> list[Source]:
    """The recordings that paths, globs, folders and URLs stand for, each once, sorted.

    Raises:
        UnusableInput: no such file, a folder without recordings, a file system that cannot be used.
    """
    found: dict[str, Source] = {}
    for text in texts:
        with _named(text):
            system, path = url_to_fs(text)
            system.invalidate_cache()
            listed = list(_list(system, path))
        if not listed:
            raise UnusableInput(f"{text}: no such file, or no recording ({', '.join(SUFFIXES)})")
        for each in listed:
            url = _address(system, each["name"])
            found[url] = Source(url, _stamp(each))
    return [found[url] for url in sorted(found)]


def _list(system: Any, path: str) -> Iterator[Mapping[str, Any]]:
    if any(character in path for character in "*?["):
        matches = system.glob(path, detail=True).values()
    else:
        matches = [system.info(path)] if system.exists(path) else []
    for match in matches:
        if match["type"] == "file":
            yield match
        else:
            inside = system.find(match["name"], detail=True)
            yield from (of for name, of in inside.items() if name.endswith(SUFFIXES))


def _address(system: Any, path: str) -> str:
    return path if _is_local(system) else str(system.unstrip_protocol(path))


def _is_local(system: Any) -> bool:
    return _LOCAL in ((system.protocol,) if isinstance(system.protocol, str) else system.protocol)


def _stamp(info: Mapping[str, Any]) -> str:
    version = next((info[key] for key in _CHANGES if info.get(key)), None)
    return "" if version is None else f"{info['size']} {version}"


@contextmanager
def _named(text: str) -> Iterator[None]:
    """Makes what goes wrong in a file system one line that names the address."""
    try:
        yield
    except UnusableInput:
        raise
    except ImportError as error:
        raise UnusableInput(f"{text}: {one_line(error, 200)}") from error
    except Exception as error:  # what fsspec's file systems raise has no common class
        reason = one_line(str(error) or type(error).__name__, 300)
        raise UnusableInput(f"{text}: cannot be listed: {reason}") from error


@contextmanager
def local_copy(url: str) -> Iterator[Path]:
    """The file at an address: itself on this machine's disks, else a copy until the end.

    Raises:
        OSError: it cannot be read; other errors, as the file system has them.
    """
    system, path = url_to_fs(url)
    if _is_local(system):
        yield Path(path)
        return
    with tempfile.TemporaryDirectory(prefix="stagectl-fleet-") as folder:
        copy = Path(folder) / "recording.h5"
        system.get_file(path, str(copy))
        yield copy


def content_of(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class Folder:
    """A folder for results, on this machine or at an address.

    Args:
        address: of it; it need not exist.

    Attributes:
        address: absolute.

    Raises:
        UnusableInput: its file system cannot be used, or a file has its name.
    """

    def __init__(self, address: str) -> None:
        with _named(address):
            self._system, self._path = url_to_fs(address)
        self._local = _is_local(self._system)
        if self._local and Path(self._path).is_file():
            raise UnusableInput(f"{address}: is a file, not a folder of results")
        self.address = _address(self._system, self._path)

    def has(self, name: str) -> bool:
        """Whether there is a file of this name, which may contain slashes."""
        return bool(self._system.exists(f"{self._path}/{name}"))

    def names(self, under: str) -> set[str]:
        """Names of all finished files below a folder of it, relative to this one."""
        self._system.invalidate_cache()
        begin = len(self._path) + 1
        found = self._system.find(f"{self._path}/{under}")
        return {name[begin:] for name in found if not name.endswith(".part")}

    def read(self, names: Iterable[str]) -> dict[str, bytes]:
        """Contents of files by name; those that are missing are left out."""
        paths = {f"{self._path}/{name}": name for name in names}
        if not paths:
            return {}
        if self._local:
            files = ((Path(path), name) for path, name in paths.items())
            return {name: path.read_bytes() for path, name in files if path.is_file()}
        contents = self._system.cat(list(paths), on_error="omit")
        return {paths[path]: content for path, content in contents.items()}

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file completely or not at all.

        Raises:
            StagectlError: it cannot be written.
        """
        path = f"{self._path}/{name}"
        if self._local:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            write_atomically(Path(path), content, "result of the fleet")
            return
        data = content.encode() if isinstance(content, str) else content
        self._system.pipe_file(path + ".part", data)
        self._system.mv(path + ".part", path)
