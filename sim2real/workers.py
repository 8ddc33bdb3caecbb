"""Threads that fits share: simulations release the interpreter, so one axis can use all cores."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers:
    """A pool whose `map` may be called from inside its own tasks: they do the rest themselves.

    Args:
        jobs: threads; 1 works where it is called.
    """

    def __init__(self, jobs: int = 1) -> None:
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
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=error is not None)

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """The function of each item, in their order."""
        if self._pool is None or getattr(self._inside, "yes", False):
            return [function(item) for item in items]
        return list(self._pool.map(function, items))
