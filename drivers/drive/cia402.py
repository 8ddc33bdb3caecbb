"""CiA 402 power state machine, controlword and statusword bits (CiA 402-2, section 7). No bus.

`next_controlword` commands one transition at a time, because some drives accept 0x06, 0x07 and 0x0F
only one by one. Transition 16 (quick stop active to enabled) is never commanded: it exists only
with some option codes, and the way through SWITCH ON DISABLED always works.
"""

from __future__ import annotations

from collections import deque
from enum import Enum, IntEnum, IntFlag


class State(Enum):
    """States of the power drive system, each as (mask, value) of the statusword."""

    NOT_READY_TO_SWITCH_ON = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION_ACTIVE = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)

    def __str__(self) -> str:
        return self.name.replace("_", " ")


class Command(IntEnum):
    """Controlwords of the device control commands (bits 7, 3, 2, 1, 0; 4 to 6 are the mode's)."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007  # from OPERATION ENABLED the same word is "disable operation"
    ENABLE_OPERATION = 0x000F
    FAULT_RESET = 0x0080


class Mode(IntEnum):
    """Modes of operation (0x6060)."""

    PROFILE_POSITION = 1
    HOMING = 6
    CYCLIC_SYNC_POSITION = 8
    CYCLIC_SYNC_VELOCITY = 9
    CYCLIC_SYNC_TORQUE = 10


MODE_NAMES = {
    0: "no mode", 1: "profile position", 3: "profile velocity", 4: "profile torque", 6: "homing",
    7: "interpolated position", 8: "cyclic synchronous position",
    9: "cyclic synchronous velocity", 10: "cyclic synchronous torque",
}  # fmt: skip
"""All modes of CiA 402, also those that the host does not use."""


class Control(IntFlag):
    """Controlword bits of the modes."""

    NEW_SETPOINT = 0x0010  # pp
    CHANGE_IMMEDIATELY = 0x0020  # pp
    RELATIVE = 0x0040  # pp
    CHANGE_ON_SETPOINT = 0x0200  # pp
    START_HOMING = 0x0010  # hm
    HALT = 0x0100


class Status(IntFlag):
    """Statusword bits besides the state."""

    VOLTAGE_ENABLED = 0x0010
    WARNING = 0x0080
    REMOTE = 0x0200
    TARGET_REACHED = 0x0400
    INTERNAL_LIMIT = 0x0800
    SETPOINT_ACKNOWLEDGED = 0x1000  # pp
    HOMING_ATTAINED = 0x1000  # hm
    FOLLOWING_ERROR = 0x2000  # pp, csp
    HOMING_ERROR = 0x2000  # hm


ENABLED_MASK, ENABLED_VALUE = State.OPERATION_ENABLED.value

_S, _C = State, Command
TRANSITIONS: dict[tuple[State, Command], tuple[int, State]] = {
    (_S.SWITCH_ON_DISABLED, _C.SHUTDOWN): (2, _S.READY_TO_SWITCH_ON),
    (_S.READY_TO_SWITCH_ON, _C.SWITCH_ON): (3, _S.SWITCHED_ON),
    (_S.SWITCHED_ON, _C.ENABLE_OPERATION): (4, _S.OPERATION_ENABLED),
    (_S.OPERATION_ENABLED, _C.SWITCH_ON): (5, _S.SWITCHED_ON),
    (_S.SWITCHED_ON, _C.SHUTDOWN): (6, _S.READY_TO_SWITCH_ON),
    (_S.READY_TO_SWITCH_ON, _C.DISABLE_VOLTAGE): (7, _S.SWITCH_ON_DISABLED),
    (_S.READY_TO_SWITCH_ON, _C.QUICK_STOP): (7, _S.SWITCH_ON_DISABLED),
    (_S.OPERATION_ENABLED, _C.SHUTDOWN): (8, _S.READY_TO_SWITCH_ON),
    (_S.OPERATION_ENABLED, _C.DISABLE_VOLTAGE): (9, _S.SWITCH_ON_DISABLED),
    (_S.SWITCHED_ON, _C.DISABLE_VOLTAGE): (10, _S.SWITCH_ON_DISABLED),
    (_S.SWITCHED_ON, _C.QUICK_STOP): (10, _S.SWITCH_ON_DISABLED),
    (_S.OPERATION_ENABLED, _C.QUICK_STOP): (11, _S.QUICK_STOP_ACTIVE),
    (_S.QUICK_STOP_ACTIVE, _C.DISABLE_VOLTAGE): (12, _S.SWITCH_ON_DISABLED),
    (_S.FAULT, _C.FAULT_RESET): (15, _S.SWITCH_ON_DISABLED),
}
"""(state, command) -> (number of the transition, next state), for all that the host commands."""

AUTOMATIC: dict[State, tuple[int, State]] = {
    _S.NOT_READY_TO_SWITCH_ON: (1, _S.SWITCH_ON_DISABLED),
    _S.FAULT_REACTION_ACTIVE: (14, _S.FAULT),
}
"""Transitions that the drive makes by itself; also 0, power on, and 13, any state to a fault."""


def decode(statusword: int) -> State:
    """The state that a statusword shows.

    Bits 0..3 may form a combination that CiA 402 does not define. It counts as NOT READY TO SWITCH
    ON, in which nothing is commanded.
    """
    for state in State:
        mask, value = state.value
        if statusword & mask == value:
            return state
    return State.NOT_READY_TO_SWITCH_ON


def next_command(state: State, target: State) -> Command | None:
    """The command for the first transition on the shortest way from `state` to `target`.

    Returns:
        None where `state` is `target`, or the drive leaves `state` by itself.

    Raises:
        ValueError: no command leads to `target` (FAULT, for instance).
    """
    if target is State.FAULT or target in AUTOMATIC:
        raise ValueError(f"{target} cannot be commanded")
    if state is target or state in AUTOMATIC:
        return None
    queue = deque([(state, None)])  # type: deque[tuple[State, Command | None]]
    seen = {state}
    while queue:
        at, first = queue.popleft()
        for (origin, command), (_, after) in TRANSITIONS.items():
            if origin is at and after not in seen:
                if after is target:
                    return command if first is None else first
                seen.add(after)
                queue.append((after, command if first is None else first))
    raise ValueError(f"no transition leads from {state} to {target}")


def next_controlword(state: State, target: State, previous: int = 0) -> int:
    """The controlword to send in `state` on the way to `target`.

    Args:
        state: what the statusword shows.
        target: the state wanted.
        previous: controlword sent last; only a rising edge of bit 7 resets a fault, so a word with
            this bit is followed by one without.

    Raises:
        ValueError: no command leads to `target`.
    """
    if state is target:
        return HOLD.get(state, previous)
    command = next_command(state, target)
    if state is State.NOT_READY_TO_SWITCH_ON and target is not State.SWITCH_ON_DISABLED:
        return int(Command.SHUTDOWN)  # some drives show 0x0000 until the first controlword
    if command is None:
        return previous & ~Command.FAULT_RESET
    if command is Command.FAULT_RESET and previous & Command.FAULT_RESET:
        return int(Command.DISABLE_VOLTAGE)
    return int(command)


HOLD: dict[State, int] = {
    _S.SWITCH_ON_DISABLED: int(_C.DISABLE_VOLTAGE),
    _S.READY_TO_SWITCH_ON: int(_C.SHUTDOWN),
    _S.SWITCHED_ON: int(_C.SWITCH_ON),
    _S.OPERATION_ENABLED: int(_C.ENABLE_OPERATION),
    _S.QUICK_STOP_ACTIVE: int(_C.QUICK_STOP),
}
"""The controlword that keeps a drive in a state."""
