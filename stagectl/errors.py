"""Exceptions of the application, one class for each way a command can fail.

With the exit code of the command line:

    StagectlError          1    other failures
    |- ConfigError         2    machine or recipe file: all problems, one line each
    |- UnusableInput       2    any other unusable input (recording, journal, no such bus)
    |- RunFault            3    the run ended with a fault of stage, bus or drive
    |- LimitsMissed        4    the run is complete, but misses the recipe's limits
    `- Aborted           130    the operator stopped the run

The message is for the operator: one line (in a `ConfigError`, one per problem) that names file or
axis, key or object, and cause. The command line prints only that. Exceptions of the other packages
(`drivers.errors`, ...) become `RunFault` in the sequencer, or by `drivers_failures`.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import ClassVar


class StagectlError(Exception):
    """A failure reported to the operator as one line, never as a traceback.

    Attributes:
        exit_code: of the process, if this ends a command.
    """

    exit_code: ClassVar[int] = 1


class ConfigError(StagectlError):
    """An invalid machine or recipe file.

    Attributes:
        problems: all problems, one line `file:line:column: key: reason` each.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (
            (problems,) if isinstance(problems, str) else tuple(problems)
        )
        super().__init__("\n".join(self.problems))


class UnusableInput(StagectlError):  # noqa: N818
    """An unusable input other than a configuration file: names file, place and cause."""

    exit_code: ClassVar[int] = 2


def missing_extra(what: str, packages: str, extra: str, instead: str = "") -> UnusableInput:
    """That something needs packages which are not installed, with the command that installs them.

    Args:
        what: needs them, with its verb: "fleets need".
        packages: that are missing.
        extra: of stagectl that has them.
        instead: what else would do.
    """
    return UnusableInput(f"{what} {packages}: pip install 'stagectl[{extra}]'{instead}")


@contextmanager
def unusable(*kinds: type[Exception], about: str = "") -> Iterator[None]:
    """Makes errors of some kinds an `UnusableInput`, with what they are about before their text."""
    try:
        yield
    except kinds as error:
        raise UnusableInput(f"{about}{error}") from error


@contextmanager
def drivers_failures() -> Iterator[None]:
    """Makes errors of the drivers those of the application.

    Raises:
        UnusableInput: there is no such bus.
        RunFault: bus, node or axis failed.
    """
    from drivers.errors import BusOpenError, DriverError

    try:
        with unusable(BusOpenError):
            yield
    except DriverError as error:
        raise RunFault(str(error)) from error


_WRONG_PATH = frozenset(
    (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.ENOTDIR, errno.EISDIR,
     errno.ENAMETOOLONG, errno.ELOOP)
)  # fmt: skip


def failure_to_write(text: str, error: OSError) -> StagectlError:
    """What to raise where a file or folder cannot be written.

    Args:
        text: names it.
        error: of the system.

    Returns:
        `UnusableInput` where another path would do (no permission, no such folder); otherwise, as
        for a full disk, `StagectlError`.
    """
    kind = UnusableInput if error.errno in _WRONG_PATH else StagectlError
    return kind(f"{text}: {error.strerror or error}")


class RunFault(StagectlError):  # noqa: N818
    """The run ended with a fault of the stage, the bus or a drive: names axis, object and cause."""

    exit_code: ClassVar[int] = 3


class LimitsMissed(StagectlError):  # noqa: N818
    """The run is complete; sites of it miss the limits of its recipe."""

    exit_code: ClassVar[int] = 4


class Aborted(StagectlError):  # noqa: N818
    """The operator stopped the run; the samples recorded so far are kept."""

    exit_code: ClassVar[int] = 130
