"""A history written by a thread of its own: whoever has a record hands it over and goes on.

A disk that is slow, a database that another program holds, a server that is gone or does not answer
concern this thread alone. It opens a connection for itself, tries again after longer and longer
pauses where that is lost, and files then what has come meanwhile.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress

from stagectl.errors import StagectlError
from stagectl.history.port import History
from stagectl.history.records import EstimateRecord, StepRecord

Record = EstimateRecord | StepRecord

LIMIT = 20_000
"""So many records wait for a history at most, about 25 MB; further ones are left to an import."""
BATCH = 200
"""So many are filed in one transaction."""
PAUSE, LONGEST_PAUSE = 0.25, 30.0
"""First and longest pause before another try [s]."""
PATIENCE = 10.0
"""The end of a run waits so long for its history [s]."""


class HistoryWriter:
    """Files the records of a run in the order in which they are handed over.

    Make it before motion begins: the thread inherits its scheduling (`drivers.cyclic.realtime`).

    Args:
        reopen: opens the history for writing; called in the thread, also after a failure.
        limit: so many records wait at most.

    Attributes:
        failure: why the last try did not succeed, else None.
        filed: estimates that the history has.
        turned_away: records that there was no room for.
        complete: every record is filed, and what `end` was given done.
    """

    def __init__(self, reopen: Callable[[], History], limit: int = LIMIT) -> None:
        self.failure: str | None = None
        self.filed = self.turned_away = 0
        self.complete = False
        self._reopen = reopen
        self._waiting: queue.Queue[Record | None] = queue.Queue(limit)
        self._close: Callable[[History], None] | None = None
        self._ending, self._abandoned = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name="history", daemon=True)
        self._thread.start()

    def hand_over(self, record: Record) -> None:
        """Take a record; never waits."""
        try:
            self._waiting.put_nowait(record)
        except queue.Full:
            self.turned_away += 1

    def end(self, close: Callable[[History], None], patience: float = PATIENCE) -> None:
        """Wait until all is filed, but not for longer than `patience` [s].

        A thread that a database still keeps then is left alone; it ends when it is let go.

        Args:
            close: called in the thread with the history once all that waited is filed.
            patience: [s].
        """
        self._close = close
        self._ending.set()
        with suppress(queue.Full):  # then the thread does not sleep
            self._waiting.put_nowait(None)
        self._thread.join(patience)
        self._abandoned.set()

    def _work(self) -> None:
        history: History | None = None
        batch: Sequence[Record] = ()
        pause = PAUSE
        while not self._abandoned.is_set():
            try:
                if history is None:
                    history = self._reopen()
                batch = batch or self._take()
                if not batch:
                    self._finish(history)
                    break
                self._file(history, batch)
            except StagectlError as error:
                self.failure = str(error)
                if history is not None:
                    history.close()
                    history = None
                self._rest(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
            else:
                batch, pause, self.failure = (), PAUSE, None
        if history is not None:
            history.close()

    def _take(self) -> list[Record]:
        """What waits, as many as go together; sleeps until there is something. Nothing: the end."""
        taken: list[Record] = []
        with suppress(queue.Empty):
            while len(taken) < BATCH:
                record = self._waiting.get(block=not taken and not self._ending.is_set())
                if record is not None:
                    taken.append(record)
        return taken

    def _file(self, history: History, batch: Sequence[Record]) -> None:
        estimates = [record for record in batch if isinstance(record, EstimateRecord)]
        if estimates:
            history.add(estimates)
        for record in batch:
            if isinstance(record, StepRecord):
                history.add_step(record)
        self.filed += len(estimates)

    def _finish(self, history: History) -> None:
        if self._close is not None:
            self._close(history)
        self.complete = not self.turned_away
        self.failure = None

    def _rest(self, pause: float) -> None:
        """Before another try; the end of the run is worth one at once, and short pauses."""
        if self._ending.is_set():
            self._abandoned.wait(min(pause, 2.0 * PAUSE))
        else:
            self._ending.wait(pause)
