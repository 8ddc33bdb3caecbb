"""What a drive watches by itself while its force is on, and what it calls a fault.

Following error (outside 0x6065 for longer than 0x6066), end switch (over-travel), and full force
for too long, far from the demand (over-current): something holds the axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from hil_sim.cia301 import OVER_CURRENT, OVER_TRAVEL, Dictionary
from hil_sim.cia402 import objects as o
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment

SWITCH_DISTANCE = 5e-3
"""End switches beyond the travel, where the mechanics are [m]."""
OVERLOAD_SHARE, OVERLOAD_NS = 0.98, 200_000_000
"""Over-current: this share of the peak force for so long ..."""
OVERLOAD_ERROR = 10e-6
"""... at more than this following error [m]."""


class Supervision:
    """Watches one axis.

    Args:
        dictionary: with window and timeout of the following error.
        motor: that is watched.
        segment: whose time it is.
        fault: called with the code of a fault.
        left: called instead where the following error is the fault.
        reacting: whether the drive is brought to a stop for a fault already.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        motor: Motor,
        segment: CanSegment,
        fault: Callable[[int], None],
        left: Callable[[], None],
        reacting: Callable[[], bool],
    ) -> None:
        self._dictionary, self._motor, self._segment = dictionary, motor, segment
        self._fault, self._left, self._reacting = fault, left, reacting
        self._outside_ns: int | None = None
        self._overloaded_ns: int | None = None
        self._beyond = False
        self._overload = OVERLOAD_ERROR / motor.unit
        self._window, self._calm, self._timeout_ns = math.inf, self._overload, 0
        settings = motor.settings
        self._switches = tuple(
            round((limit + side * SWITCH_DISTANCE) / settings.increment)
            for limit, side in zip(settings.travel, (-1, 1), strict=True)
        )

    def configure(self) -> None:
        """Take over what the dictionary says."""
        window = self._dictionary.integer(o.FOLLOWING_WINDOW)
        self._window = math.inf if window == o.OFF else float(window)
        self._calm = min(self._window, self._overload)
        self._timeout_ns = self._dictionary.integer(o.FOLLOWING_TIMEOUT) * 1_000_000

    def forget_position(self) -> None:
        """The axis begins anew at its demand."""
        self._outside_ns = None

    def forget_force(self) -> None:
        """Force that was too large does not count any more."""
        self._overloaded_ns = None

    def switches(self) -> int:
        """End switches: bit 0 the lower one, bit 1 the upper one."""
        counter, (low, high) = self._motor.counter(), self._switches
        return (counter <= low) | (counter >= high) << 1

    def travel(self) -> None:
        """End switches; a fault on the way out only, so that the axis can be brought back."""
        low, high = self._switches
        beyond = not low <= self._motor.counter() <= high
        if beyond is not self._beyond:
            self._beyond = beyond
            if beyond:
                self._fault(OVER_TRAVEL)

    def following(self, worst: float) -> None:
        """Over-current and following error, by the worst following error [units]."""
        if worst <= self._calm:
            self._overloaded_ns = self._outside_ns = None
            return
        if worst > self._overload:
            self._force()
        else:
            self._overloaded_ns = None
        if worst <= self._window:
            self._outside_ns = None
            return
        if self._reacting():
            return
        now = self._segment.now_ns
        if self._outside_ns is None:
            self._outside_ns = now
        if now - self._outside_ns >= self._timeout_ns:
            self._left()

    def _force(self) -> None:
        now = self._segment.now_ns
        control = self._motor.settings.control
        full = OVERLOAD_SHARE * 1000 * control.peak_force / control.rated_force
        if abs(self._motor.force()) < full:
            self._overloaded_ns = None
        elif self._overloaded_ns is None:
            self._overloaded_ns = now
        elif now - self._overloaded_ns >= OVERLOAD_NS:
            self._fault(OVER_CURRENT)
