"""Commands of stagectl that the console has run beside the stage: child processes of low priority.

One at a time, so that they take at most one processor from a stage that moves. They end with the
console.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from stagectl.errors import StagectlError
from stagectl.plain_text import one_line

_LOWEST = "19"
_LINE = 400


@dataclass
class Job:
    """A long command.

    Attributes:
        what: in words.  folder: name of the folder with its files.
        began, ended: [s since 1970]; None while it runs.
        code: exit code, negative where a signal ended it.
        line: the last it has said.
    """

    what: str
    folder: str
    began: float
    ended: float | None = None
    code: int | None = None
    line: str = ""


class Jobs:
    """Runs one command after the other.

    Attributes:
        latest: the job under way or the last one.
    """

    def __init__(self) -> None:
        self.latest: Job | None = None
        self._process: asyncio.subprocess.Process | None = None
        self._task: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()

    def as_dict(self) -> dict[str, Any] | None:
        """The latest job for the page."""
        return None if self.latest is None else asdict(self.latest)

    def begin(self, what: str, folder: Path, arguments: Sequence[str]) -> None:
        """Begin with a long command.

        Raises:
            StagectlError: another one is under way.
        """
        if self.latest is not None and self.latest.ended is None:
            raise StagectlError(f"under way: {self.latest.what}")
        self.latest = Job(what, folder.name, time.time())
        self._task = asyncio.create_task(self._run(self.latest, arguments))

    def cancel(self) -> None:
        """End the long command under way, if any."""
        if self._process is not None and self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGTERM)

    async def close(self) -> None:
        """End all."""
        self.cancel()
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self, job: Job, arguments: Sequence[str]) -> None:
        try:
            self._process = await _start(arguments, asyncio.subprocess.STDOUT)
            assert self._process.stdout is not None  # noqa: S101 (it is a pipe)
            async for line in self._process.stdout:
                job.line = one_line(line.decode(errors="replace").strip(), _LINE) or job.line
            job.code = await self._process.wait()
        except (OSError, ValueError) as why:
            job.line, job.code = one_line(str(why), _LINE), 1
        finally:
            self.cancel()
            job.ended = time.time()

    async def ask(self, arguments: Sequence[str], timeout: float = 60.0) -> str:
        """Run a short command, and return what it prints.

        Raises:
            StagectlError: it fails, with its message, or takes too long.
        """
        async with self._turn:
            process = await _start(arguments, asyncio.subprocess.PIPE)
            try:
                out, errors = await asyncio.wait_for(process.communicate(), timeout)
            except TimeoutError:
                raise StagectlError(f"took longer than {timeout:g} s") from None
            finally:
                if process.returncode is None:
                    process.kill()
        if process.returncode:
            lines = errors.decode(errors="replace").strip().splitlines() or ["failed"]
            raise StagectlError(one_line(lines[-1].removeprefix("stagectl: "), _LINE))
        return out.decode(errors="replace")


async def _start(arguments: Sequence[str], errors: int) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        "nice", "-n", _LOWEST, sys.executable, "-m", "stagectl", *arguments,
        stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=errors,
        start_new_session=True,
    )  # fmt: skip
