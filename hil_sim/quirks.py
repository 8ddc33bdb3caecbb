"""What a drive may do with the force offset and the position on the bus that its papers do not say.

The loops inside the drive are not touched: they see the encoder as it is. Offsets change where SYNC
takes them over, positions where SYNC samples them (`Drive.on_sync`); what SDO reads is the present
position.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from stagedata.ranges import NotNegative, check_ranges

Delay = Annotated[int, Interval(ge=0, le=100)]
Share = Annotated[float, Interval(ge=0, le=1)]
_FORGOTTEN = 10
"""After so many periods without a SYNC the samples before say nothing."""


@dataclass(frozen=True, slots=True)
class Quirks:
    """Of one drive; the defaults are a drive without."""

    offset_delay: Delay = 0
    """SYNCs by which the force offset (0x60B2) acts too late."""
    offset_sign: Literal[1, -1] = 1
    """-1: the force offset acts the other way."""
    offset_step: Share = 0.0
    """The force offset acts in steps of this share of the rated force; 0: as sent."""
    position_delay: Delay = 0
    """SYNCs by which the position actual value (0x6064) is too old."""
    position_filter: NotNegative = 0.0
    """Time constant of a low-pass on 0x6064 [s]; 0: none."""

    def __post_init__(self) -> None:
        check_ranges(self)


class OddOffset:
    """Makes of a force offset what acts."""

    def __init__(self, quirks: Quirks) -> None:
        self._sign, self._step = quirks.offset_sign, 1000.0 * quirks.offset_step
        self._waiting: deque[float] = deque([0.0] * quirks.offset_delay)

    def clear(self) -> None:
        """Forget what has not acted yet: the power is off, or switched on."""
        self._waiting = deque([0.0] * len(self._waiting))

    def take(self, permille: int) -> float:
        """What acts from this SYNC on [1/1000 rated], once the next one is sent."""
        acting = self._sign * float(permille)
        if self._step:
            acting = self._step * round(acting / self._step)
        self._waiting.append(acting)
        return self._waiting.popleft()


class OddPosition:
    """Makes of the encoder counters at SYNC what is sampled.

    The low-pass runs through them as if straight between two SYNCs.
    """

    def __init__(self, quirks: Quirks) -> None:
        self._delay, self._time = quirks.position_delay, quirks.position_filter
        self._recent: deque[float] = deque(maxlen=quirks.position_delay + 1)
        self._filtered = self._before = 0.0
        self._last_ns = self._period_ns = 0

    def sample(self, counter: int, now_ns: int) -> int:
        """The counter [increments] that a SYNC at this time [ns] samples."""
        passed = now_ns - self._last_ns
        self._last_ns = now_ns
        if not self._recent or passed > _FORGOTTEN * self._period_ns > 0:
            self._recent.clear()
            self._filtered = self._before = float(counter)
        elif self._time:
            span = passed * 1e-9 / self._time
            lag = (counter - self._before) / span if span else 0.0  # of a ramp, in the long run
            keep = math.exp(-span)
            self._filtered = counter - lag + keep * (self._filtered - self._before + lag)
            self._before = float(counter)
        else:
            self._filtered = float(counter)
        self._period_ns = passed
        self._recent.append(self._filtered)
        return round(self._recent[0])
