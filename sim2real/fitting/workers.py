"""Threads shared by fits: simulations release the interpreter, so one axis can use all cores."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from types import TracebackType
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")


class Stopped(Exception):  # noqa: N818  (an end, not an error: it is not reported)
    """Work whose result is no longer wanted."""


class Workers:
    """A pool whose `map` may be called from its own tasks, which then do the work themselves.

    Left by an error or by Ctrl-C, it stops the work in progress: a thread cannot be ended from
    outside, so long work calls `check` to learn whether it is still wanted. Within `with` linear
    algebra has one thread: more of them inside each of these would wait for each other at full
    load, and small systems are solved no faster.

    Args:
        jobs: threads; 1 works in the caller's.
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
        self._linear_algebra = threadpool_limits(1, user_api="blas")
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
        self._linear_algebra.restore_original_limits()

    def spread(
        self,
        function: Callable[[Sequence[Item]], Sequence[Result]],
        items: Sequence[Item],
        most: int,
    ) -> list[Result | None]:
        """Apply a function to several items at a time, in as many parts as there are threads.

        Args:
            function: gives a result for each of the items it is given; ValueError if it cannot for
                one of them, whose result then is None.
            items: divided into equal parts of at most `most`.
            most: items at a time.

        Raises:
            Stopped: the result is no longer wanted.
        """
        count = max(-(-len(items) // most), min(self._idle(), len(items)))
        edges = [len(items) * part // count for part in range(count + 1)] if items else [0]
        parts = [items[first:last] for first, last in pairwise(edges)]
        done = self.map(partial(_apply, function), parts)
        return [result for part in done for result in part]

    def _idle(self) -> int:
        """Threads that a map called from here can use."""
        return 1 if self._pool is None or getattr(self._inside, "yes", False) else self._jobs

    def check(self) -> None:
        """Return only if the result is still wanted.

        Raises:
            Stopped: it is not.
        """
        if self._stopped.is_set():
            raise Stopped

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Apply a function to each item, in their order.

        Raises:
            Stopped: the result is no longer wanted.
        """
        self.check()
        if self._pool is None or self._idle() == 1:
            return [function(item) for item in items]
        try:
            return list(self._pool.map(function, items))
        except (RuntimeError, CancelledError):  # also of a pool that was shut down meanwhile
            self.check()
            raise


def _apply(
    function: Callable[[Sequence[Item]], Sequence[Result]], items: Sequence[Item]
) -> list[Result | None]:
    """The results of some items; where one has none, of either half by itself."""
    try:
        return [*function(items)]
    except ValueError:
        half = len(items) // 2
        if not half:
            return [None]
        return [*_apply(function, items[:half]), *_apply(function, items[half:])]
