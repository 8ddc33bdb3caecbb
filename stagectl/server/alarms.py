"""Faults of the stage as people see them: what it means, what to do, who has acknowledged it."""

from __future__ import annotations

from drivers.canopen.emcy import error_text
from stagectl.protocol.state import Alarm
from stagectl.server.handover import Fault

_KEPT = 200

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
        self._alarms = [*self._alarms[-_KEPT:], alarm]
        return alarm

    def acknowledge(self, number: int, client: str) -> Alarm | None:
        """Acknowledge an alarm; None where there is no open one of this number."""
        for place, alarm in enumerate(self._alarms):
            if alarm.id == number and alarm.acknowledged_by is None:
                done = alarm.model_copy(update={"acknowledged_by": client})
                self._alarms[place] = done
                return done
        return None
