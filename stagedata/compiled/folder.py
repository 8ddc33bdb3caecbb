"""The folder in which compiled kernels are kept. Whoever can write there runs code as this user.

So folder and files must belong to this user or root, and nobody else may write them. What does not
is refused with the reason, as a warning of the log; kernels are then compiled without being kept.
Nothing here follows a link.
"""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import BinaryIO, cast

import numba

_OWN = 0o700
_OWN_FILE = 0o600
_ROOT = 0


class Refused(OSError):  # noqa: N818
    """A folder or file that is not safe to use; the message names it and says why."""


@dataclass(frozen=True, slots=True)
class KernelFolder:
    """A folder of kernels.

    Args:
        path: of the folder; made, for this user only, when a kernel is kept.
        missing: why there can be none, or None.
    """

    path: Path
    missing: str | None = None

    def problem(self) -> str | None:
        """Why it cannot be used, naming it; None if it can, or is still to be made."""
        try:
            with self._opened():
                return None
        except FileNotFoundError:
            return None
        except Refused as error:
            return str(error)
        except OSError as error:
            return f"{self.path}: {error.strerror}"

    def read(self, name: str) -> bytes | None:
        """Content of a kernel's file; None if there is none, a part of one, or not a safe one."""
        if (problem := self.problem()) is not None:
            return _refuse(problem)
        try:
            with self._opened() as folder, self._file(name, os.O_RDONLY, folder) as file:
                content = file.read()
                with suppress(OSError):  # another user's; `drop` goes by when it was used
                    os.utime(file.fileno())
        except Refused as error:
            return _refuse(str(error))
        except OSError:
            return None
        return whole(content)

    def write(self, name: str, data: bytes) -> None:
        """Keep a kernel.

        Raises:
            OSError: it cannot be kept.
        """
        with self._opened(make=True) as folder:
            part = f"{name}.{os.getpid()}"
            with suppress(FileNotFoundError):
                os.unlink(part, dir_fd=folder)
            try:
                with self._file(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, folder) as file:
                    file.write(hashlib.sha256(data).digest() + data)
                os.replace(part, name, src_dir_fd=folder, dst_dir_fd=folder)
            except OSError:
                with suppress(OSError):
                    os.unlink(part, dir_fd=folder)
                raise

    def lock(self, name: str) -> BinaryIO | None:
        """Wait for the lock of a name, which lasts until the file is closed.

        Returns:
            None where there can be no lock.
        """
        try:
            with self._opened(make=True) as folder:
                file = self._file(name, os.O_WRONLY | os.O_CREAT, folder)
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:  # not in this folder, or not on this file system
            return None
        return file

    def drop(self, kernel: str, kept: int = 0) -> None:
        """Remove all files of a kernel but those that were used last."""
        if self.problem() is None:
            files = self.path.glob(f"{kernel}-*.kernel")
            by_use = sorted(files, key=lambda path: path.lstat().st_mtime, reverse=True)
            for path in by_use[kept:]:
                path.unlink(missing_ok=True)

    @contextmanager
    def _opened(self, make: bool = False) -> Iterator[int]:
        """The folder, checked.

        Raises:
            FileNotFoundError: there is none.
            Refused: it is not safe to use.
            OSError: it cannot be opened or made.
        """
        if self.missing is not None:
            raise Refused(self.missing)
        if make:
            self.path.mkdir(_OWN, parents=True, exist_ok=True)
        if self.path.is_symlink():
            raise Refused(f"{self.path}: is a link")
        folder = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            _check(os.fstat(folder), self.path)
            yield folder
        finally:
            os.close(folder)

    def _file(self, name: str, flags: int, folder: int) -> BinaryIO:
        """A file of the open folder, checked.

        Raises:
            Refused: it is not safe to use.
            OSError: it cannot be opened.
        """
        path, mode = self.path / name, "wb" if flags & os.O_WRONLY else "rb"
        flags |= os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK
        try:
            file = os.fdopen(os.open(name, flags, _OWN_FILE, dir_fd=folder), mode)
        except OSError as error:
            if path.is_symlink():
                raise Refused(f"{path}: is a link") from error
            raise
        try:
            _check(os.fstat(file.fileno()), path)
        except Refused:
            file.close()
            raise
        return cast(BinaryIO, file)


def whole(content: bytes) -> bytes | None:
    """The kernel in the content of a file; None if that is only a part of one."""
    digest, data = content[:32], content[32:]
    return data if hashlib.sha256(data).digest() == digest else None


@cache
def kernel_folder() -> KernelFolder:
    """Where new kernels are kept.

    That of NUMBA_CACHE_DIR; else the `__pycache__` beside this file, where it is this user's own;
    else the user's cache.
    """
    if numba.config.CACHE_DIR:
        return KernelFolder(Path(numba.config.CACHE_DIR, "stagectl"))
    beside = KernelFolder(Path(__file__).parent / "__pycache__")
    with suppress(OSError):
        beside.path.mkdir(exist_ok=True)
        tempfile.TemporaryFile(dir=beside.path).close()
        if beside.problem() is None:
            return beside
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    try:
        return KernelFolder(Path(home).expanduser() / "stagectl")
    except RuntimeError:
        return KernelFolder(Path(home), "no home folder; NUMBA_CACHE_DIR names another")


def _check(found: os.stat_result, path: Path) -> None:
    """Refuse what others own or can write."""
    if found.st_uid not in (os.geteuid(), _ROOT):
        raise Refused(f"{path}: belongs to another user (uid {found.st_uid})")
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise Refused(f"{path}: others can write it (mode {stat.S_IMODE(found.st_mode):04o})")


def _refuse(problem: str) -> bytes | None:
    """Nothing, and a line that says why."""
    _tell(f"{problem}: compiled kernels are not taken from there")
    return None


@cache
def _tell(line: str) -> None:
    """A line of the log, once."""
    logging.getLogger(__name__).warning(line)
