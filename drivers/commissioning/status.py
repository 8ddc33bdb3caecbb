"""Status of an axis, read by SDO and put into plain words; nothing is changed or moved.

An object that the drive does not have is left out; it is no error here.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers import objects as od
from drivers.canopen import error_text, register_text
from drivers.drive import MODE_NAMES, Axis, State, Status, decode, unit

STANDSTILL = 1e-3
"""An enabled axis slower than this is described as holding [m/s]."""
_INPUTS = (
    (0, "at the negative limit switch"), (1, "at the positive limit switch"),
    (3, "interlock active (STO or enable input)"),
)  # fmt: skip


def mode_text(mode: int) -> str:
    """A mode of operation (0x6060, 0x6061) in words."""
    return MODE_NAMES.get(mode, f"mode {mode}")


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """One axis at one moment; None for what its drive does not report.

    Attributes:
        axis: name.  node: id.  nmt: NMT state, from heartbeats.
        statusword: 0x6041.  state: that it shows.  words: the status in plain words.
        mode: 0x6061.  position: [m].  force: [N].
        error_code: 0x603F.  error_register: 0x1001.
        error_history: newest error codes of 0x1003, newest first.
        sto: 0x60FD bit 3: safe torque off active, or enable input open.
        brake: 0x60FE:01 bit 0: holding brake set.
    """

    axis: str
    node: int
    nmt: str | None
    statusword: int
    state: State
    words: str
    mode: int | None
    position: float | None
    force: float | None
    error_code: int | None
    error_register: int | None
    error_history: tuple[int, ...]
    sto: bool | None = None
    brake: bool | None = None

    @property
    def mode_text(self) -> str:
        """The mode in words."""
        return "-" if self.mode is None else mode_text(self.mode)


def in_words(
    statusword: int,
    error_code: int | None = None,
    velocity: float | None = None,
    inputs: int | None = None,
    outputs: int | None = None,
) -> str:
    """The status of an axis in plain words.

    Args:
        statusword: 0x6041.
        error_code: 0x603F; None, here as below, where the drive does not report it.
        velocity: 0x606C [m/s].
        inputs: 0x60FD: bits 0 and 1 limit switches, 3 interlock.
        outputs: 0x60FE:01: bit 0 sets the brake.
    """
    state = decode(statusword)
    words = {
        State.NOT_READY_TO_SWITCH_ON: "starting up, no force",
        State.SWITCH_ON_DISABLED: "off, no force",
        State.READY_TO_SWITCH_ON: "off, no force, ready",
        State.SWITCHED_ON: "on, no force yet",
        State.OPERATION_ENABLED: "enabled, under force",
        State.QUICK_STOP_ACTIVE: "stopped by quick stop, under force",
        State.FAULT_REACTION_ACTIVE: "fault, stopping",
        State.FAULT: "fault, no force",
    }[state]
    if state is State.OPERATION_ENABLED and velocity is not None:
        words = "enabled, " + ("holding" if abs(velocity) < STANDSTILL else "moving")
    if state in (State.FAULT, State.FAULT_REACTION_ACTIVE) and error_code:
        words += f": {error_text(error_code)}"
    if not statusword & Status.VOLTAGE_ENABLED and state is not State.FAULT:
        explained = (inputs or 0) & od.INTERLOCK
        words += "; no supply voltage" + ("" if explained else " (STO, contactor or mains)")
    if statusword & Status.WARNING:
        words += "; warning"
    if statusword & Status.INTERNAL_LIMIT:
        words += "; internal limit active"
    if not statusword & Status.REMOTE:
        words += "; ignores commands from the bus (local control)"
    clauses = [words, *(text for bit, text in _INPUTS if (inputs or 0) >> bit & 1)]
    if outputs is not None:
        clauses.append("brake set" if outputs & 1 else "brake released")
    return "; ".join(clauses)


def status_of(axis: Axis) -> AxisStatus:
    """Reads the axis' status.

    Raises:
        NodeError: the node does not answer, or has no statusword.
    """
    node = axis.node
    statusword = node.read(od.STATUSWORD)
    optional = node.read_if_offered
    position, force = optional(od.POSITION_ACTUAL), optional(od.FORCE_ACTUAL)
    code, speed = optional(od.ERROR_CODE), optional(od.VELOCITY_ACTUAL)
    velocity = None if speed is None else speed * unit(axis.settings, od.VELOCITY_ACTUAL)
    inputs, outputs = optional(od.DIGITAL_INPUTS), optional(od.DIGITAL_OUTPUTS)
    return AxisStatus(
        axis=axis.name,
        node=node.id,
        nmt=node.nmt_state,
        statusword=statusword,
        state=decode(statusword),
        words=in_words(statusword, code, velocity, inputs, outputs),
        mode=optional(od.MODE_DISPLAY),
        position=None if position is None else position * axis.increment,
        force=None if force is None else force * axis.force_unit,
        error_code=code,
        error_register=optional(od.ERROR_REGISTER),
        error_history=axis.node.error_history(),
        sto=None if inputs is None else bool(inputs & od.INTERLOCK),
        brake=None if outputs is None else bool(outputs & 1),
    )


def error_line(status: AxisStatus) -> str:
    """Error code, register and history on one line, or "none"."""
    parts = []
    if status.error_code:
        parts.append(error_text(status.error_code))
    if status.error_register:
        parts.append(f"register: {register_text(status.error_register)}")
    if status.error_history:
        parts.append("last: " + ", ".join(f"0x{code:04X}" for code in status.error_history))
    return "; ".join(parts) or "none"
