"""What a drive supervises while its force is on, and which faults follow.

Following error outside 0x6065 for longer than 0x6066; an end switch (over-travel); nearly full
force for too long at a following error that shows the axis is held (over-current).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from hil_sim.cia301 import Dictionary
from hil_sim.cia301.emergency import OVER_CURRENT, OVER_TRAVEL
from hil_sim.cia402 import objects as o
from hil_sim.plant import Motor
from hil_sim.ports import CanSegment

SWITCH_DISTANCE = 5e-3
"""Distance of the end switches beyond the travel [m]."""
OVERLOAD_SHARE, OVERLOAD_NS = 0.98, 200_000_000
"""Over-current: this share of the peak force for this long [ns] ..."""
OVERLOAD_ERROR = 10e-6
"""... at a following error above this [m]."""


class Supervision:
    """Supervises one axis.

    Args:
        dictionary: holds window and timeout of the following error.
        motor: supervised.
        segment: gives the time.
        on_fault: called with the error code.
        on_following_error: called instead for a following error.
        is_reacting: whether the drive is stopping for a fault already.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        motor: Motor,
        segment: CanSegment,
        on_fault: Callable[[int], None],
        on_following_error: Callable[[], None],
        is_reacting: Callable[[], bool],
    ) -> None:
        self._dictionary, self._motor, self._segment = dictionary, motor, segment
        self._on_fault, self._is_reacting = on_fault, is_reacting
        self._on_following_error = on_following_error
        self._outside_ns: int | None = None
        self._overloaded_ns: int | None = None
        self._beyond_travel = False
        self._overload = OVERLOAD_ERROR / motor.unit
        self._window, self._unsuspicious, self._timeout_ns = math.inf, self._overload, 0
        settings = motor.settings
        self._switches = tuple(
            round((limit + side * SWITCH_DISTANCE) / settings.increment)
            for limit, side in zip(settings.travel, (-1, 1), strict=True)
        )

    def configure(self) -> None:
        """Read window and timeout from the dictionary."""
        window = self._dictionary.integer(o.FOLLOWING_WINDOW)
        self._window = math.inf if window == o.OFF else float(window)
        self._unsuspicious = min(self._window, self._overload)
        self._timeout_ns = self._dictionary.integer(o.FOLLOWING_TIMEOUT) * 1_000_000

    def reset_following(self) -> None:
        """Restart the timeout: the axis is at its demand."""
        self._outside_ns = None

    def reset_force(self) -> None:
        """Restart the time at nearly full force."""
        self._overloaded_ns = None

    def end_switches(self) -> int:
        """State of the end switches: bit 0 the lower, bit 1 the upper one."""
        counter, (low, high) = self._motor.counter(), self._switches
        return (counter <= low) | (counter >= high) << 1

    def check_travel(self) -> None:
        """Check the end switches; only passing one outwards is a fault, so the axis can return."""
        low, high = self._switches
        beyond = not low <= self._motor.counter() <= high
        if beyond is not self._beyond_travel:
            self._beyond_travel = beyond
            if beyond:
                self._on_fault(OVER_TRAVEL)

    def check_following(self, worst: float) -> None:
        """Check force and following error.

        Args:
            worst: largest following error since the last call [units].
        """
        if worst <= self._unsuspicious:
            self._overloaded_ns = self._outside_ns = None
            return
        if worst > self._overload:
            self._check_force()
        else:
            self._overloaded_ns = None
        if worst <= self._window:
            self._outside_ns = None
            return
        if self._is_reacting():
            return
        now = self._segment.now_ns
        if self._outside_ns is None:
            self._outside_ns = now
        if now - self._outside_ns >= self._timeout_ns:
            self._on_following_error()

    def _check_force(self) -> None:
        now = self._segment.now_ns
        control = self._motor.settings.control
        full = OVERLOAD_SHARE * 1000 * control.peak_force / control.rated_force
        if abs(self._motor.force()) < full:
            self._overloaded_ns = None
        elif self._overloaded_ns is None:
            self._overloaded_ns = now
        elif now - self._overloaded_ns >= OVERLOAD_NS:
            self._on_fault(OVER_CURRENT)
