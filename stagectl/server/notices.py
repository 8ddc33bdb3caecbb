"""What has happened, numbered, for clients that come later; faults with what to do about them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from drivers.canopen.emcy import error_text
from stagectl.protocol.state import Alarm, Notice
from stagectl.sequencer import Event, events
from stagectl.server.handover import Fault

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
        case events.Limitation(text=text):
            return "limitation", text, {}
        case events.MoveStarted(site=site, kind=kind, time=at):
            return "move_started", _at(site, f"{kind}-move"), {"site": site, "kind": kind, "at": at}
        case events.Waiting(site=site, reason=reason, most=most):
            return "waiting", _at(site, reason), {"site": site, "reason": reason, "most": most}
        case events.Settled(site=site, kind=kind, duration=took, settled=settled):
            words = f"{kind}-move {'settled' if settled else 'not settled'} in {took * 1e3:.0f} ms"
            of_it = {"site": site, "kind": kind, "duration": took, "settled": settled}
            return "settled", _at(site, words), of_it
        case events.FrictionUpdated(site=site, axis=axis, estimate=found, place=place):
            words = f"Fc {axis} {found.friction.coulomb:.3g} N"
            refused = "" if found.accepted else f" refused: {found.reason}"
            data: dict[str, Any] = {
                "site": site, "axis": axis, "accepted": found.accepted, "reason": found.reason,
                "place": [float(p) for p in place],
                "figures": {k: float(v) for k, v in found.figures.items()},
                "sigma": {k: float(v) for k, v in found.sigma.items()},
            }  # fmt: skip
            return "friction", _at(site, words + refused), data
        case events.Exposed(site=site):
            return "exposed", _at(site, "exposed"), {"site": site}
        case events.SegmentDone(number=number, site=site):
            return "segment_done", _at(site, "done"), {"number": number, "site": site}
        case events.Retrying(segment=segment, attempt=attempt, limit=limit, fault=fault):
            words = f"{segment}: {fault}; restarting (attempt {attempt} of {limit})"
            return "retrying", words, {"number": segment, "attempt": attempt, "limit": limit}
        case events.MarkFound(site=site, offset=offset):
            return "mark_found", _at(site, "mark found"), {"site": site, "offset": list(offset)}
        case events.MarkNotFound(site=site):
            return "mark_not_found", _at(site, "mark not found, no micro-move"), {"site": site}
        case events.LevelStepped(axis=axis, place=place, change=change, everywhere=everywhere):
            where = "everywhere" if everywhere else f"at ({place[0]:g}, {place[1]:g}) m"
            words = f"friction of axis {axis} stepped by {100 * change:+.0f} % {where}"
            return "stepped", words, {"axis": axis, "place": list(place), "change": change}
        case events.ObserverFound(axis=axis, text=text, out=out):
            return "observer", text, {"axis": axis, "out": out}
        case events.Paused(most=most):
            return "paused", f"paused, for {most:g} s at most", {"most": most}
        case events.Continued(duration=duration):
            return "resumed", f"goes on after {duration:.1f} s", {"duration": duration}
        case events.StopNoticed(reason=reason) | events.Stopping(reason=reason):
            return "stopping", reason, {"reason": reason}


def _at(site: int | None, words: str) -> str:
    return words if site is None else f"site {site}: {words}"


_ALARMS_KEPT = 200

_SILENT = "The host was silent for too long: was the computer stalled? Then enable with reset."
_BY_CODE = {
    0x5441: "Release the emergency stop, then enable with reset.",
    0x8130: _SILENT,
    0x8250: _SILENT,
    0x8611: "Look for what blocks the axis, or a load that has changed; then enable with reset.",
    0x8612: "Move the axis back into its travel; then enable with reset.",
    0x8613: "Look at the home switch or index mark; then home again.",
}
_BY_CLASS = {
    0x2: "Look for a short circuit or an overload in motor and cable before power returns.",
    0x3: "Look at the supply of the drives before power returns.",
    0x4: "Let it cool down and look at the ventilation before power returns.",
    0x5: "The drive's hardware reports a failure: see its manual before power returns.",
    0x7: "Look at encoder and motor cables before power returns.",
}
_BUS = "Look at cable, termination and supply of the bus; then enable with reset."
_OTHER = "Find the cause, then enable with reset."


def advice(fault: Fault) -> str:
    """What to do about a fault."""
    if fault.code is not None:
        return _BY_CODE.get(fault.code) or _BY_CLASS.get(fault.code >> 12) or _OTHER
    return _BUS if fault.axis is None else _OTHER


class Alarms:
    """The alarms, oldest first."""

    def __init__(self) -> None:
        self._alarms: list[Alarm] = []
        self._number = 0

    @property
    def open(self) -> tuple[Alarm, ...]:
        """Those that nobody has acknowledged."""
        return tuple(alarm for alarm in self._alarms if alarm.acknowledged_by is None)

    def take(self, fault: Fault) -> Alarm:
        """A new alarm."""
        self._number += 1
        known = fault.code is not None and error_text(fault.code) not in fault.text
        text = f"{fault.text} ({error_text(fault.code)})" if known and fault.code else fault.text
        alarm = Alarm(
            id=self._number, time=fault.time, axis=fault.axis, text=text, advice=advice(fault)
        )
        self._alarms = [*self._alarms[-_ALARMS_KEPT:], alarm]
        return alarm

    def acknowledge(self, number: int, client: str) -> Alarm | None:
        """Acknowledge an alarm; None where there is no open one of this number."""
        for place, alarm in enumerate(self._alarms):
            if alarm.id == number and alarm.acknowledged_by is None:
                done = alarm.model_copy(update={"acknowledged_by": client})
                self._alarms[place] = done
                return done
        return None
