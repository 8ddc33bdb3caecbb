"""Merges all that is known of a fault into one exception.

Emergencies, error code (0x603F), error register (0x1001), error history (0x1003), statusword, last
commands. What the host knows is recorded at once (`gather`); what has to be read from the drive
waits until nothing moves (`complete`).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from drivers import objects as od
from drivers.canopen import REBOOTED, Node, error_text, register_text
from drivers.cyclic import Channel
from drivers.drive import Command, Control, Status, decode, dimension, unit
from drivers.errors import AxisFault, DriverError, FaultReport, NodeError

_COMMAND_BITS = 0x8F
_BITS = (
    (Control.NEW_SETPOINT, "bit 4"),
    (Control.CHANGE_IMMEDIATELY, "bit 5"),
    (Control.RELATIVE, "bit 6"),
    (Control.HALT, "halt"),
)


def gather(channel: Channel) -> FaultReport:
    """What the host knows of an axis at this moment; sends nothing."""
    axis = channel.axis
    return FaultReport(
        statusword=channel.statusword if channel.seen else None,
        emergencies=tuple(axis.node.emergencies),
        controlwords=tuple(channel.sent_controlwords),
        mode=None if axis.mode is None else int(axis.mode),
        target=_target_text(channel),
        offset=channel.offset * axis.force_unit,
        boots=axis.node.booted,
    )


def _target_text(channel: Channel) -> str:
    axis, target = channel.axis, channel.axis.target
    value = channel.target * unit(axis.settings, target)
    digits = {od.TARGET_FORCE: 4, od.TARGET_VELOCITY: 6}.get(target, 9)
    return f"{value:.{digits}g} {dimension(axis.settings, target)}"


def command_text(controlword: int) -> str:
    """A controlword in words."""
    if controlword & Command.FAULT_RESET:
        text = "fault reset"
    else:
        command = controlword & _COMMAND_BITS
        known = [c for c in Command if int(c) == command]
        text = known[0].name.replace("_", " ").lower() if known else f"0x{controlword:04X}"
    extra = [name for bit, name in _BITS if controlword & bit]
    return text + "".join(f" + {name}" for name in extra)


def commands_text(report: FaultReport) -> str:
    """The last commands in words."""
    words = " > ".join(command_text(w) for w in report.controlwords) or "none"
    mode = "" if report.mode is None else f", mode {report.mode}"
    return f"{words}{mode}, target {report.target}, force offset {report.offset:.4g} N"


def axis_fault(channel: Channel, what: str) -> AxisFault:
    """An `AxisFault` with statusword and first emergency; `complete` adds the rest."""
    alarm = channel.axis.node.alarm
    parts = [what] if alarm is None else [what, alarm.cause]
    parts.append(f"statusword 0x{channel.statusword:04X} ({channel.state})")
    return AxisFault(
        "; ".join(parts), axis=channel.axis.name, obj=od.STATUSWORD,
        code=None if alarm is None else alarm.code,
    )  # fmt: skip


def complete(problem: AxisFault, channel: Channel, report: FaultReport) -> AxisFault:
    """The same fault with all that is known of it; reads by SDO, whose errors are ignored.

    Args:
        problem: the fault as noticed.
        channel: of its axis, which is at rest or lost.
        report: what the host knew at the moment it was noticed.
    """
    if problem.report is not None:
        return problem
    node = channel.axis.node
    code = read_quietly(node, od.ERROR_CODE)
    if code is not None:  # a node that does not answer costs one timeout, not three
        register = read_quietly(node, od.ERROR_REGISTER)
        report = replace(report, error_code=code, error_register=register)
        with suppress(DriverError):
            report = replace(report, history=node.error_history())
    return type(problem)(
        "; ".join(_clauses(problem.cause, report, node)), axis=problem.axis, obj=problem.object,
        code=problem.code or report.code, report=report,
    )  # fmt: skip


def read_quietly(node: Node, ref: od.ObjectRef) -> int | None:
    """An object's value; None where it cannot be read."""
    try:
        return None if node.silent else node.read_if_offered(ref)
    except NodeError:
        return None


def _clauses(cause: str, report: FaultReport, node: Node) -> list[str]:
    """The cause, then what it does not mention yet; each code once."""
    parts = [cause]
    if node.booted > report.boots:  # which also explains a silence
        parts.append(REBOOTED)
    for emergency in report.emergencies:
        if f"0x{emergency:04X}" not in "".join(parts):
            parts.append(f"emergency: {error_text(emergency)}")
    code, word = report.error_code, report.statusword
    if code and f"0x{code:04X}" not in "".join(parts):
        parts.append(f"0x603F:00 error code: {error_text(code)}")
    if report.error_register and "error register" not in cause:
        parts.append(f"error register: {register_text(report.error_register)}")
    if word is not None and not word & Status.VOLTAGE_ENABLED:
        parts.append("no supply voltage (STO, contactor or mains)")
        if (read_quietly(node, od.DIGITAL_INPUTS) or 0) & od.INTERLOCK:
            parts.append("0x60FD:00 digital inputs: interlock active (STO or enable input)")
    mentioned = "".join(parts)
    older = [error_text(h) for h in dict.fromkeys(report.history) if f"0x{h:04X}" not in mentioned]
    if older:
        parts.append("earlier errors: " + ", ".join(older))
    if word is not None and "statusword 0x" not in cause:
        warning = ", warning" if word & Status.WARNING else ""
        parts.append(f"statusword 0x{word:04X} ({decode(word)}{warning})")
    return [*parts, f"last commands: {commands_text(report)}"]
