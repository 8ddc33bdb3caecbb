"""What a homing's statuswords mean."""

from __future__ import annotations

import pytest

from drivers.motion.homing import Progress, judge, timeout_for
from drivers.settings import AxisSettings

# statusword bits 13, 12, 10 of CiA 402-2, homing mode
IN_PROGRESS, INTERRUPTED, ATTAINED, DONE = 0x0237, 0x0637, 0x1237, 0x1637
ERROR_MOVING, ERROR_STOPPED = 0x2237, 0x2637


@pytest.mark.parametrize(
    ("word", "before", "elapsed", "after"),
    [
        (INTERRUPTED, Progress.WAITING, 0.0, Progress.WAITING),  # not begun yet looks the same
        (IN_PROGRESS, Progress.WAITING, 0.0, Progress.RUNNING),
        (IN_PROGRESS, Progress.RUNNING, 1.0, Progress.RUNNING),
        (INTERRUPTED, Progress.RUNNING, 1.0, Progress.INTERRUPTED),
        (ATTAINED, Progress.RUNNING, 1.0, Progress.RUNNING),  # still moving: not done
        (DONE, Progress.RUNNING, 1.0, Progress.DONE),
        (DONE, Progress.WAITING, 0.001, Progress.WAITING),  # of an earlier homing
        (DONE, Progress.WAITING, 0.1, Progress.DONE),  # a drive that is done at once
        (ERROR_MOVING, Progress.RUNNING, 1.0, Progress.FAILED),
        (ERROR_STOPPED, Progress.WAITING, 0.0, Progress.FAILED),
    ],
)
def test_judge(word: int, before: Progress, elapsed: float, after: Progress) -> None:
    assert judge(word, before, elapsed) is after


def test_the_timeout_covers_the_travel_both_ways(axis_settings: tuple[AxisSettings, ...]) -> None:
    assert timeout_for(axis_settings[0]) > 2 * 0.3 / 0.002
