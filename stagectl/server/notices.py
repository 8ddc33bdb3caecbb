"""What has happened, numbered, for clients that come later or have missed some."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from stagectl.protocol.state import Notice
from stagectl.sequencer import (
    Continued,
    Event,
    Exposed,
    FrictionUpdated,
    LevelStepped,
    Limitation,
    MarkFound,
    MarkNotFound,
    MoveStarted,
    ObserverFound,
    Paused,
    Retrying,
    SegmentDone,
    Settled,
    StopNoticed,
    Stopping,
    Waiting,
)

_KEPT = 1000


class Notices:
    """The notices kept.

    Args:
        publish: called with each.

    Attributes:
        number: of the last one.
    """

    def __init__(self, publish: Callable[[Notice], object]) -> None:
        self._publish = publish
        self._notices: deque[Notice] = deque(maxlen=_KEPT)
        self.number = 0

    def say(
        self,
        kind: str,
        text: str,
        data: dict[str, Any] | None = None,
        when: float | None = None,
    ) -> None:
        """Something has happened, now or then [s since 1970]."""
        self.number += 1
        notice = Notice(
            number=self.number,
            time=time.time() if when is None else when,
            kind=kind,
            text=text,
            data=data or {},
        )
        self._notices.append(notice)
        self._publish(notice)

    def since(self, number: int) -> list[Notice]:
        """The notices above a number."""
        return [notice for notice in self._notices if notice.number > number]


def in_words(event: Event) -> tuple[str, str, dict[str, Any]]:
    """Kind, words and figures of an event of a run."""
    match event:
        case Limitation(text=text):
            return "limitation", text, {}
        case MoveStarted(site=site, kind=kind, time=at):
            return "move_started", _at(site, f"{kind}-move"), {"site": site, "kind": kind, "at": at}
        case Waiting(site=site, reason=reason, most=most):
            return "waiting", _at(site, reason), {"site": site, "reason": reason, "most": most}
        case Settled(site=site, kind=kind, duration=took, settled=settled):
            words = f"{kind}-move {'settled' if settled else 'not settled'} in {took * 1e3:.0f} ms"
            of_it = {"site": site, "kind": kind, "duration": took, "settled": settled}
            return "settled", _at(site, words), of_it
        case FrictionUpdated(site=site, axis=axis, estimate=found, place=place):
            words = f"Fc {axis} {found.friction.coulomb:.3g} N"
            refused = "" if found.accepted else f" refused: {found.reason}"
            data: dict[str, Any] = {
                "site": site, "axis": axis, "accepted": found.accepted, "reason": found.reason,
                "place": [float(p) for p in place],
                "figures": {k: float(v) for k, v in found.figures.items()},
                "sigma": {k: float(v) for k, v in found.sigma.items()},
            }  # fmt: skip
            return "friction", _at(site, words + refused), data
        case Exposed(site=site):
            return "exposed", _at(site, "exposed"), {"site": site}
        case SegmentDone(number=number, site=site):
            return "segment_done", _at(site, "done"), {"number": number, "site": site}
        case Retrying(segment=segment, attempt=attempt, limit=limit, fault=fault):
            words = f"{segment}: {fault}; restarting (attempt {attempt} of {limit})"
            return "retrying", words, {"number": segment, "attempt": attempt, "limit": limit}
        case MarkFound(site=site, offset=offset):
            return "mark_found", _at(site, "mark found"), {"site": site, "offset": list(offset)}
        case MarkNotFound(site=site):
            return "mark_not_found", _at(site, "mark not found, no micro-move"), {"site": site}
        case LevelStepped(axis=axis, place=place, change=change, everywhere=everywhere):
            where = "everywhere" if everywhere else f"at ({place[0]:g}, {place[1]:g}) m"
            words = f"friction of axis {axis} stepped by {100 * change:+.0f} % {where}"
            return "stepped", words, {"axis": axis, "place": list(place), "change": change}
        case ObserverFound(axis=axis, text=text, out=out):
            return "observer", text, {"axis": axis, "out": out}
        case Paused(most=most):
            return "paused", f"paused, for {most:g} s at most", {"most": most}
        case Continued(duration=duration):
            return "resumed", f"goes on after {duration:.1f} s", {"duration": duration}
        case StopNoticed(reason=reason) | Stopping(reason=reason):
            return "stopping", reason, {"reason": reason}


def _at(site: int | None, words: str) -> str:
    return words if site is None else f"site {site}: {words}"
