"""What can go wrong in the application, one exception class per way a command can end.

The tree, with the exit code that the command line answers with:

    StagectlError          1    anything of ours that has no better class
    |- ConfigError         2    machine or recipe file: every problem found, one line each
    |- UnusableInput       2    any other input that cannot be used (recording, offsets, journal)
    |- RunFault            3    the run ended on a fault of stage, bus or drive
    `- Aborted           130    the operator stopped the run

The text of an exception is for the operator: one clear line (one line per problem in a
`ConfigError`) that names file or axis, key or object, and cause. The command line prints that
text and nothing else. Faults of the lower packages keep their own trees (`drivers.errors`, ...);
the sequencer turns them into `RunFault`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar


class StagectlError(Exception):
    """A failure that is reported to the operator as text, never as a traceback.

    Attributes:
        exit_code: what the process exits with when this ends a command.
    """

    exit_code: ClassVar[int] = 1


class ConfigError(StagectlError):
    """A machine or recipe file that does not hold what it must.

    Attributes:
        problems: every problem found, each one line `file:line:column: key: reason`.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems: tuple[str, ...] = (
            (problems,) if isinstance(problems, str) else tuple(problems)
        )
        super().__init__("\n".join(self.problems))


class UnusableInput(StagectlError):  # noqa: N818
    """An input other than a configuration file that cannot be used: names file, place and cause."""

    exit_code: ClassVar[int] = 2


class RunFault(StagectlError):  # noqa: N818
    """The run ended on a fault of the stage, the bus or a drive: names axis, object and cause."""

    exit_code: ClassVar[int] = 3


class Aborted(StagectlError):  # noqa: N818
    """The operator stopped the run; what was recorded until then is kept."""

    exit_code: ClassVar[int] = 130
