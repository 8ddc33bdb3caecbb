"""A thread that writes the history, so that nothing else ever waits for it.

A slow disk, a database locked by another program, or a server that is gone or does not answer
delays only this thread. It has its own connection; when that is lost it reconnects after growing
pauses and then files the records queued meanwhile.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from stagectl.errors import StagectlError
from stagectl.history.records import EstimateRecord, RunEntry, StepRecord
from stagectl.history.sql import History

Record = EstimateRecord | StepRecord

LIMIT = 20_000
"""Largest number of queued records, about 25 MB; more are dropped and must be imported later."""
BATCH = 200
"""Records filed per transaction."""
PAUSE, LONGEST_PAUSE = 0.25, 30.0
"""First and longest pause between attempts [s]."""
PATIENCE = 10.0
"""The end of a run waits this long for its history [s]."""


class HistoryWriter:
    """Enters a run, then files its records in order.

    Create it before motion begins: the thread inherits its scheduling (`drivers.cyclic.realtime`).

    Args:
        reopen: opens the history for writing; called in the thread, also after a failure.
        entry: of the run, whose number its records get.
        limit: largest number of queued records.

    Attributes:
        failure: why the last attempt failed, or None.
        filed: number of estimates in the history.
        dropped: number of records that the queue had no room for.
        complete: every record is filed, and the callback of `end` has been called.
    """

    def __init__(self, reopen: Callable[[], History], entry: RunEntry, limit: int = LIMIT) -> None:
        self.failure: str | None = None
        self.filed = self.dropped = 0
        self.complete = False
        self._reopen, self._entry = reopen, entry
        self._run = 0
        self._queue: queue.Queue[Record | None] = queue.Queue(limit)
        self._close: Callable[[History, int], None] | None = None
        self._ending, self._abandoned = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name="history", daemon=True)
        self._thread.start()

    def enqueue(self, record: Record) -> None:
        """Queue a record; never waits."""
        try:
            self._queue.put_nowait(record)
        except queue.Full:
            self.dropped += 1

    def end(self, close: Callable[[History, int], None], patience: float = PATIENCE) -> None:
        """Wait until everything is filed, for `patience` at most.

        A thread that is still waiting for a database after that is left to end on its own.

        Args:
            close: called in the thread with the history and the number of the run, once
                everything is filed.
            patience: [s].
        """
        self._close = close
        self._ending.set()
        with suppress(queue.Full):  # with a full queue the thread is awake
            self._queue.put_nowait(None)
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
                    self._run = history.start_run(self._entry)
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
                self._wait(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
            else:
                batch, pause, self.failure = (), PAUSE, None
        if history is not None:
            history.close()

    def _take(self) -> list[Record]:
        """Up to BATCH queued records; waits for the first one, and returns none at the end."""
        taken: list[Record] = []
        with suppress(queue.Empty):
            while len(taken) < BATCH:
                record = self._queue.get(block=not taken and not self._ending.is_set())
                if record is not None:
                    taken.append(record)
        return taken

    def _file(self, history: History, batch: Sequence[Record]) -> None:
        estimates = [replace(r, run=self._run) for r in batch if isinstance(r, EstimateRecord)]
        if estimates:
            history.add(estimates)
        for record in batch:
            if isinstance(record, StepRecord):
                history.add_step(replace(record, run=self._run))
        self.filed += len(estimates)

    def _finish(self, history: History) -> None:
        if self._close is not None:
            self._close(history, self._run)
        self.complete = not self.dropped
        self.failure = None

    def _wait(self, pause: float) -> None:
        """Pause before another attempt; the end of the run cuts it short, later ones are short."""
        if self._ending.is_set():
            self._abandoned.wait(min(pause, 2.0 * PAUSE))
        else:
            self._ending.wait(pause)
