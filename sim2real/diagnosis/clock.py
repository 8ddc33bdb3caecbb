"""A common clock of several recordings, for effects that fade with time.

An axis that warms up does so once: what has faded in one recording is not there again in the next.
That tells such effects from those that only look alike within one recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import pairwise

from stagedata import Recording

LONGEST_PAUSE = 900.0
"""Longest pause between two recordings that share a clock [s]: three times the longest usual time
constant of a warm-up. After a longer pause the axis may have cooled down, which no recording
shows."""


@dataclass(frozen=True, slots=True)
class Clock:
    """When recordings started.

    Attributes:
        starts: of each recording, since the first one started [s]; zeros without a common clock.
        text: the sentence about it in the report; None where there is a single recording.
    """

    starts: tuple[float, ...]
    text: str | None = None


def find_common_clock(recordings: Sequence[Recording]) -> Clock:
    """The common clock of recordings of one stage, in any order, if they have one."""
    own = (0.0,) * len(recordings)
    if len(recordings) < 2:
        return Clock(own)
    begun = [_read_time(recording.started) for recording in recordings]
    first = min((b for b in begun if b is not None), default=None)
    starts: tuple[float, ...] = own
    why: str | None
    if first is None or None in begun:
        without = recordings[begun.index(None)]
        why = f"{without.source} has no start time with a zone"
    else:
        starts = tuple((b - first) / timedelta(seconds=1) for b in begun if b is not None)
        why = _why_apart(recordings, starts)
    if why is not None:
        return Clock(own, f"effects that fade count time from each recording's start: {why}")
    return Clock(
        starts,
        f"effects that fade count time from the first recording's start; the last one began "
        f"{max(starts):.4g} s later",
    )


def continue_clock(recordings: Sequence[Recording], others: Sequence[Recording]) -> Clock:
    """The clock of other recordings of the stage that counts from the first of `recordings`.

    Without one, each of the others counts from its own start, or from the first of them.
    """
    clock = find_common_clock([*recordings, *others])
    count = len(recordings)
    if not any(clock.starts):
        return find_common_clock(others)
    first = min(clock.starts[:count])
    return replace(clock, starts=tuple(start - first for start in clock.starts[count:]))


def _why_apart(recordings: Sequence[Recording], starts: Sequence[float]) -> str | None:
    """Why these start times are not used, or None."""
    order = sorted(range(len(starts)), key=lambda i: starts[i])
    for before, after in pairwise(order):
        names = f"{recordings[before].source} and {recordings[after].source}"
        time = recordings[before].time
        pause = starts[after] - starts[before] - float(time[-1] - time[0])
        if pause < -1.0:  # start times are often logged in whole seconds
            return f"{names} overlap by their start times"
        if pause > LONGEST_PAUSE:
            return f"between {names} are {pause:.4g} s, in which the axes may have cooled down"
    return None


def _read_time(text: str) -> datetime | None:
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return None if time.tzinfo is None else time
