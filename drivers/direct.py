"""Velocities (csv) and forces (cst) as cyclic set-points, checked before and watched meanwhile.

Both begin and end at 0: nothing follows the last row. A stream that is ended early brakes at the
acceleration limit (csv) or lets go (cst). Forces know no travel and no speed limit by themselves;
so in cst an axis that could no longer stop within its travel, or is too fast, ends the stream.
"""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.channel import Channel
from drivers.clock import Clock
from drivers.cycle import Cycle, Until
from drivers.errors import AxisFault
from drivers.samples import decode_rows
from stagedata import Samples

_SPEED_OVER = 5
"""SYNCs over which the speed of an axis is taken."""
_REACTION = 0.01
"""From there to the drive's braking [s]."""


class Guard:
    """Looks at the positions of a stream of forces; to be used as its `until`.

    Args:
        channels: of all axes.  clock: of the stream.  until: asked besides.
    """

    def __init__(self, channels: Sequence[Channel], clock: Clock, until: Until | None) -> None:
        self._channels, self._clock, self._until = channels, clock, until
        self._past: deque[tuple[int, tuple[float, ...]]] = deque(maxlen=_SPEED_OVER + 1)

    def __call__(self, positions: tuple[float, ...]) -> bool:
        """Whether to end the stream.

        Raises:
            AxisFault: an axis is too fast, or could not stop within its travel any more.
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
                f"at {at:.6g} m and {speed:.4g} m/s it could hardly stop before the limit "
                f"{low if below else high:g} m",
                axis=s.name, obj=od.SOFT_LIMIT_LOW if below else od.SOFT_LIMIT_HIGH,
            )  # fmt: skip


def stream(
    cycle: Cycle,
    targets: NDArray[np.int64],
    offsets: NDArray[np.int64],
    until: Until | None,
    period: float,
) -> Samples:
    """Streams velocities or forces in the mode that the axes are in; they end at 0.

    Args:
        cycle: its axes are enabled in csv or cst.
        targets: int64[K, n], checked.
        offsets: int64[K, n], checked.
        until: gets the actual positions [m] after each SYNC; True ends the stream.
        period: Ts [s].

    Returns:
        What came back; `position_demand` holds the targets: [m/s] in csv, [N] in cst.

    Raises:
        BusError, AxisFault: as `Cycle.stream`.
    """
    channels, rows = cycle.channels, array("q")
    cycle.stream(targets, offsets, rows, None, until)
    left = np.array([c.target for c in channels])
    if left.any():
        steps = 1
        if channels[0].axis.target == od.TARGET_VELOCITY:
            slope = [
                c.axis.settings.acceleration / c.axis.settings.velocity_unit_si * period
                for c in channels
            ]
            steps = max(1, math.ceil(max(abs(v) / a for v, a in zip(left, slope, strict=True))))
        shape = 1 - np.arange(1, steps + 1)[:, None] / steps
        braking = np.rint(left * shape).astype(np.int64)
        cycle.stream(braking, np.zeros_like(braking), rows, None, None)
    forces = channels[0].axis.target == od.TARGET_FORCE
    return decode_rows(
        rows,
        [c.axis.scale for c in channels],
        [c.axis.scale.force if forces else c.axis.settings.velocity_unit_si for c in channels],
    )
