"""A fault and all that is known of it, as one exception: what the drive says and what it was told.

Merges emergency messages, error code (0x603F), error register (0x1001), error history (0x1003) and
statusword with the last commands. What is kept by the host is taken at once (`gather`), what
has to be asked for is read when nothing moves any more (`explained`).
"""

from __future__ import annotations

from drivers import objects as od
from drivers.canopen import REBOOTED, error_text, register_text
from drivers.cyclic import Channel
from drivers.drive import Command, Control, Status, decode
from drivers.errors import (
    AxisFault,
    ConfigurationError,
    DriverError,
    Evidence,
    FaultReport,
    NodeError,
)

HISTORY_LENGTH = 4
_COMMAND_BITS = 0x8F
_BITS = (
    (Control.NEW_SETPOINT, "bit 4"),
    (Control.CHANGE_IMMEDIATELY, "bit 5"),
    (Control.RELATIVE, "bit 6"),
    (Control.HALT, "halt"),
)


def gather(channel: Channel) -> Evidence:
    """What the host knows of an axis as things are now; sends nothing."""
    axis = channel.axis
    return Evidence(
        statusword=channel.statusword if channel.seen else None,
        emergencies=tuple(axis.node.emergencies),
        controlwords=tuple(channel.told),
        mode=None if axis.mode is None else int(axis.mode),
        target=_target_text(channel),
        offset=channel.offset * axis.scale.force,
        boots=axis.node.booted,
    )


def _target_text(channel: Channel) -> str:
    axis = channel.axis
    if axis.target == od.TARGET_FORCE:
        return f"{channel.target * axis.scale.force:.4g} N"
    if axis.target == od.TARGET_VELOCITY:
        return f"{channel.target * axis.settings.velocity_unit_si:.6g} m/s"
    return f"{channel.target * axis.scale.increment:.9g} m"


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


def commands_text(evidence: Evidence) -> str:
    """The last commands in words."""
    words = " > ".join(command_text(w) for w in evidence.controlwords) or "none"
    mode = "" if evidence.mode is None else f", mode {evidence.mode}"
    return f"{words}{mode}, target {evidence.target}, force offset {evidence.offset:.4g} N"


def explained(problem: AxisFault, channel: Channel, evidence: Evidence) -> AxisFault:
    """The same fault with everything known of it; reads by SDO, never raises for that.

    Args:
        problem: what was noticed.
        channel: of its axis, at rest or lost by now.
        evidence: from when it was noticed.
    """
    if problem.report is not None:
        return problem
    node = channel.axis.node

    def optional(ref: od.ObjectRef) -> int | None:
        try:
            return node.read(ref) if node.offers(ref) and not node.silent else None
        except (NodeError, ConfigurationError):
            return None

    code, register = optional(od.ERROR_CODE), None
    history: tuple[int, ...] = ()
    if code is not None:  # a node that does not answer costs one timeout, not three
        register = optional(od.ERROR_REGISTER)
        try:
            history = node.error_history(HISTORY_LENGTH)
        except DriverError:
            pass
    report = FaultReport(evidence, code, register, history)
    parts = [problem.cause]
    if node.booted > evidence.boots:  # it was silent for as long as that took
        parts.append(REBOOTED)
    for other in evidence.emergencies:
        if f"0x{other:04X}" not in "".join(parts):
            parts.append(f"emergency: {error_text(other)}")
    if code and f"0x{code:04X}" not in "".join(parts):
        parts.append(f"0x603F:00 error code: {error_text(code)}")
    if register and "error register" not in problem.cause:
        parts.append(f"error register: {register_text(register)}")
    if evidence.statusword is not None and not evidence.statusword & Status.VOLTAGE_ENABLED:
        parts.append("no supply voltage (STO, contactor or mains)")
        inputs = optional(od.DIGITAL_INPUTS)
        if inputs and inputs & od.INTERLOCK:
            parts.append("0x60FD:00 digital inputs: interlock active (STO or enable input)")
    told = "".join(parts)
    older = [error_text(h) for h in dict.fromkeys(history) if f"0x{h:04X}" not in told]
    if older:
        parts.append("earlier errors: " + ", ".join(older))
    if evidence.statusword is not None and "statusword 0x" not in problem.cause:
        bits = ", warning" if evidence.statusword & Status.WARNING else ""
        parts.append(
            f"statusword 0x{evidence.statusword:04X} ({decode(evidence.statusword)}{bits})"
        )
    parts.append(f"last commands: {commands_text(evidence)}")
    return type(problem)(
        "; ".join(parts), axis=problem.axis, obj=problem.object,
        code=problem.code or report.code, report=report,
    )  # fmt: skip
