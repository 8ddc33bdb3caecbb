"""A client-side time-out for a server that does not answer.

The server's own `statement_timeout` does not help where the server or the network hangs. A thread
here shuts the connection down, and whoever waits on it gets an error at once.
"""

from __future__ import annotations

import math
import os
import socket
import threading
import time
from contextlib import suppress
from types import TracebackType

LOOK_EVERY = 0.25
"""Interval of the checks [s]."""


class Watchdog:
    """Cuts a connection that does not answer in time; a context manager around each wait.

    Args:
        descriptor: of the connection's socket, which is duplicated.
        patience: for each wait [s]; a wait inside another one starts it again.

    Attributes:
        patience: [s].
        cut: whether the connection was cut.
    """

    def __init__(self, descriptor: int, patience: float) -> None:
        self.patience = patience
        self.cut = False
        self._until, self._depth = math.inf, 0
        self._over = threading.Event()
        self._socket = socket.socket(fileno=os.dup(descriptor))
        threading.Thread(target=self._watch, name="history watchdog", daemon=True).start()

    def __enter__(self) -> None:
        self._depth += 1
        self._until = time.monotonic() + self.patience

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._depth -= 1
        self._until = time.monotonic() + self.patience if self._depth else math.inf

    def close(self) -> None:
        """Stop watching; the connection stays as it is. Idempotent."""
        self._over.set()

    def _watch(self) -> None:
        with self._socket:
            while not self._over.wait(LOOK_EVERY):
                if time.monotonic() > self._until:
                    self.cut = True
                    with suppress(OSError):  # the other end may have closed it
                        self._socket.shutdown(socket.SHUT_RDWR)
                    return
