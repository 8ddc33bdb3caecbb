"""Threads that fits share: simulations release the interpreter, so one axis can use all cores."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from itertools import pairwise
from types import TracebackType
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class Stopped(Exception):  # noqa: N818  (an end, not an error: nobody is told of it)
    """Work whose result nobody waits for any more."""


class Workers:
    """A pool whose `map` may be called from inside its own tasks: they do the rest themselves.

    Left by an error or by Ctrl-C, it stops what is still at work: a thread cannot be ended from
    outside, so long work asks with `check` whether it is still wanted.

    Args:
        jobs: threads; 1 works where it is called.
    """

    def __init__(self, jobs: int = 1) -> None:
        self._jobs = jobs
        self._stopped = threading.Event()
        self._inside = threading.local()
        self._pool = (
            ThreadPoolExecutor(jobs, initializer=lambda: setattr(self._inside, "yes", True))
            if jobs > 1
            else None
        )

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None:
            self._stopped.set()
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=error is not None)

    def spread(
        self,
        function: Callable[[Sequence[Item]], Sequence[Result]],
        items: Sequence[Item],
        most: int,
    ) -> list[Result]:
        """A function of several items at once, in as many parts as there are threads.

        Args:
            function: gives a result for each of the items it is given.
            items: in parts of `most` or less, each as large as the others.
            most: items at once.

        Raises:
            Stopped: nobody waits for it any more.
        """
        count = max(-(-len(items) // most), min(self._idle(), len(items)))
        edges = [len(items) * part // count for part in range(count + 1)] if items else [0]
        parts = [items[first:last] for first, last in pairwise(edges)]
        return [result for part in self.map(function, parts) for result in part]

    def _idle(self) -> int:
        """Threads that a map from here can use."""
        return 1 if self._pool is None or getattr(self._inside, "yes", False) else self._jobs

    def check(self) -> None:
        """Go on only where the result is still waited for.

        Raises:
            Stopped: it is not.
        """
        if self._stopped.is_set():
            raise Stopped

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """The function of each item, in their order.

        Raises:
            Stopped: nobody waits for it any more.
        """
        self.check()
        if self._pool is None or self._idle() == 1:
            return [function(item) for item in items]
        try:
            return list(self._pool.map(function, items))
        except (RuntimeError, CancelledError):  # of a pool that was shut down meanwhile, too
            self.check()
            raise
