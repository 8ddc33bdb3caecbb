"""What clients have asked for and what became of it; who waits for it."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable

from stagectl.errors import Aborted, RunFault, StagectlError
from stagectl.protocol.state import Job

_REMEMBERED = 200
_MOST_WAITING = 1000


class Jobs:
    """The jobs, the last ones of which are remembered."""

    def __init__(self) -> None:
        self._jobs: OrderedDict[int, Job] = OrderedDict()
        self._waiting: list[tuple[int, float, Callable[[Job], object]]] = []
        self._number = 0

    def begin(self, what: str) -> Job:
        """A new job."""
        self._number += 1
        job = self._jobs[self._number] = Job(id=self._number, what=what, ended=False)
        while len(self._jobs) > _REMEMBERED:
            self._jobs.popitem(last=False)
        return job

    def end(self, number: int, result: object, error: BaseException | None) -> None:
        """A job has ended; who waits for it is answered."""
        before = self._jobs[number]
        self._jobs[number] = before.model_copy(
            update={
                "ended": True,
                "result": result if isinstance(result, dict) else None,
                "error": None if error is None else str(error) or type(error).__name__,
                "kind": None if error is None else _kind(error),
            }
        )
        self.answer()

    def find(self, number: int) -> Job | None:
        """A job, or None where it is unknown or forgotten."""
        return self._jobs.get(number)

    def wait(self, number: int, timeout: float, answer: Callable[[Job], object]) -> None:
        """Call `answer` with a job that is known when it has ended, or after `timeout` [s].

        Where very many wait, those that have waited for longest are answered at once.
        """
        while len(self._waiting) >= _MOST_WAITING:
            other, _, early = self._waiting.pop(0)
            early(self._jobs.get(other) or _forgotten(other))
        self._waiting.append((number, time.monotonic() + timeout, answer))
        self.answer()

    def answer(self) -> None:
        """Answer those whose job has ended or whose time is over."""
        now, left = time.monotonic(), []
        for number, deadline, answer in self._waiting:
            job = self._jobs.get(number)
            if job is None or job.ended or now >= deadline:
                answer(job or _forgotten(number))
            else:
                left.append((number, deadline, answer))
        self._waiting = left


def _forgotten(number: int) -> Job:
    return Job(id=number, what="", ended=True, error="forgotten", kind="refused")


def _kind(error: BaseException) -> str:
    if isinstance(error, Aborted):
        return "stopped"
    if isinstance(error, RunFault):
        return "fault"
    return "refused" if isinstance(error, StagectlError) else "internal"
