"""Guards the travel in streams of forces, which imply neither travel nor velocity limits.

An axis that is too fast, or could no longer stop within its travel, ends the stream.

Source: CiA 402-2, mode 10: 0x6071.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from drivers import objects as od
from drivers.canopen import Clock
from drivers.cyclic import Channel, Until
from drivers.errors import AxisFault

_SPEED_OVER = 5
"""SYNCs over which an axis' velocity is measured."""
_REACTION = 0.01
"""Time until the drive brakes [s]."""


class TravelGuard:
    """Watches velocity and travel during a stream of forces, as its `until`.

    Args:
        channels: of all axes.  clock: of the stream.  until: the application's.
    """

    def __init__(self, channels: Sequence[Channel], clock: Clock, until: Until | None) -> None:
        self._channels, self._clock, self._until = channels, clock, until
        self._past: deque[tuple[int, tuple[float, ...]]] = deque(maxlen=_SPEED_OVER + 1)

    def __call__(self, positions: tuple[float, ...]) -> bool:
        """Whether to end the stream.

        Raises:
            AxisFault: an axis is too fast, or could no longer stop within its travel.
        """
        now = self._clock.now_ns()
        self._past.append((now, positions))
        then, before = self._past[0]
        if len(self._past) > _SPEED_OVER and now > then:
            for channel, at, was in zip(self._channels, positions, before, strict=True):
                self._check(channel, at, (at - was) / (now - then) * 1e9)
        return self._until is not None and self._until(positions)

    @staticmethod
    def _check(channel: Channel, at: float, speed: float) -> None:
        s = channel.axis.settings
        if abs(speed) > s.velocity:
            raise AxisFault(
                f"{abs(speed):.4g} m/s exceeds the velocity limit {s.velocity:g} m/s",
                axis=s.name, obj=od.TARGET_FORCE,
            )  # fmt: skip
        low, high = s.travel
        rest = at + speed * _REACTION + math.copysign(speed * speed / (2 * s.acceleration), speed)
        if not low <= rest <= high:
            below = rest < low
            raise AxisFault(
                f"at {at:.6g} m and {speed:.4g} m/s it may not stop before the limit "
                f"{low if below else high:g} m",
                axis=s.name, obj=od.SOFT_LIMIT_LOW if below else od.SOFT_LIMIT_HIGH,
            )  # fmt: skip
