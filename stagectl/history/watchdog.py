"""An end to waiting for a server that does not answer.

A time-out of the server's own (`statement_timeout`) is worth nothing where it is the server that
hangs, or the network has become a black hole. Here the client cuts its own connection, from a
thread beside it; whoever waits on it gets an error at once.
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
"""Between two looks at whether it has been too long [s]."""


class Watchdog:
    """Cuts a connection that is waited on for too long; as a context, around each wait.

    Args:
        descriptor: of the connection's socket; another one of it is kept.
        patience: for each wait [s]; what is inside another wait begins it anew.

    Attributes:
        patience: [s].
        cut: whether it has been too long.
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
        """Let go of the connection, which stays as it is; idempotent."""
        self._over.set()

    def _watch(self) -> None:
        with self._socket:
            while not self._over.wait(LOOK_EVERY):
                if time.monotonic() > self._until:
                    self.cut = True
                    with suppress(OSError):  # the other end has, meanwhile
                        self._socket.shutdown(socket.SHUT_RDWR)
                    return
