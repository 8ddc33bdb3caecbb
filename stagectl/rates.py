"""How often something may happen."""

from __future__ import annotations

import time
from collections.abc import Hashable

_MOST_KEYS = 1000


class Rates:
    """`burst` times at once, `rate` times a second in the long run, for each key."""

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._left: dict[Hashable, tuple[float, float]] = {}

    def allows(self, key: Hashable) -> bool:
        """Whether it may happen once more now."""
        now = time.monotonic()
        left, since = self._left.pop(key, (self._burst, now))
        left = min(self._burst, left + (now - since) * self._rate)
        while len(self._left) >= _MOST_KEYS:  # the one used longest ago is full by now
            self._left.pop(next(iter(self._left)))
        self._left[key] = (left - 1 if left >= 1 else left, now)
        return left >= 1
