"""A stage server that the console starts where none serves: a process that outlives the console.

It has a session of its own and writes to a file, so that neither a closed terminal nor a console
that is killed ends a run. What it says while it compiles and boots is shown on the page.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from stagectl.plain_text import one_line
from stagectl.protocol.endpoint import Endpoint, make_folder

LINES = 8


class ServerProcess:
    """`stagectl serve` as a child.

    Args:
        where: its sockets; its output goes beside them.
        arguments: of `serve`.
    """

    def __init__(self, where: Endpoint, arguments: Sequence[str]) -> None:
        self._where, self._arguments = where, list(arguments)
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> Path:
        """The file of its output."""
        return self._where.folder / f"{self._where.name}.log"

    def start(self) -> None:
        """Start it, unless it runs.

        Raises:
            StagectlError: the folder of the sockets is unusable.
        """
        if self.is_running:
            return
        make_folder(self._where.folder, None)
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
        log = os.open(self.log, flags, 0o600)
        try:
            self._process = subprocess.Popen(  # noqa: S603 (our own program)
                [sys.executable, "-m", "stagectl", "serve", *self._arguments],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        finally:
            os.close(log)

    @property
    def is_running(self) -> bool:
        """Whether it has been started and has not ended."""
        return self._process is not None and self._process.poll() is None

    def status(self) -> dict[str, object]:
        """For the page: whether it is ours, runs, with which code it ended, its last lines."""
        code = None if self._process is None else self._process.poll()
        return {"runs": self.is_running, "code": code, "lines": self._last_lines()}

    def _last_lines(self) -> list[str]:
        try:
            with self.log.open(encoding="utf-8", errors="replace") as file:
                file.seek(max(0, self.log.stat().st_size - 8192))
                return [one_line(line.rstrip(), 400) for line in deque(file, LINES)]
        except OSError:
            return []

    def end(self) -> None:
        """Ask it to end, and wait until its axes are switched off."""
        if self._process is not None and self.is_running:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(20)
            except subprocess.TimeoutExpired:
                return
