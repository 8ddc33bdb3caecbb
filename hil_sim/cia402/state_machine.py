"""CiA 402 power state machine, pure: states, statusword bits, transitions by controlword.

How the drive comes to a standstill on the way, fault reset (an edge, not a command) and transitions
that the drive makes by itself are in `device_profile`.
"""

from __future__ import annotations

from enum import Enum

FAULT_RESET = 1 << 7
HALT = 1 << 8


class State(Enum):
    """States; the value is statusword bits 0 to 3, 5 and 6 (bit 5: no quick stop)."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(Enum):
    """Controlword commands, encoded in bits 0, 1, 2, 3 and 7."""

    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"  # in OPERATION ENABLED the same code is "disable operation"
    ENABLE = "enable operation"
    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"


def decode(controlword: int) -> Command | None:
    """The command; None while bit 7 is set, which is fault reset only."""
    if controlword & FAULT_RESET:
        return None
    if not controlword & 0x02:
        return Command.DISABLE_VOLTAGE
    if not controlword & 0x04:
        return Command.QUICK_STOP
    if not controlword & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE if controlword & 0x08 else Command.SWITCH_ON


_S, _C = State, Command
_TRANSITIONS: dict[tuple[State, Command], State] = {
    (_S.SWITCH_ON_DISABLED, _C.SHUTDOWN): _S.READY,  # 2
    (_S.READY, _C.SWITCH_ON): _S.SWITCHED_ON,  # 3
    (_S.READY, _C.ENABLE): _S.ENABLED,  # 3 and 4 in one
    (_S.READY, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 7
    (_S.READY, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 7
    (_S.SWITCHED_ON, _C.ENABLE): _S.ENABLED,  # 4
    (_S.SWITCHED_ON, _C.SHUTDOWN): _S.READY,  # 6
    (_S.SWITCHED_ON, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 10
    (_S.SWITCHED_ON, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 10
    (_S.ENABLED, _C.SWITCH_ON): _S.SWITCHED_ON,  # 5
    (_S.ENABLED, _C.SHUTDOWN): _S.READY,  # 8
    (_S.ENABLED, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 9
    (_S.ENABLED, _C.QUICK_STOP): _S.QUICK_STOP,  # 11
    (_S.QUICK_STOP, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 12
    (_S.QUICK_STOP, _C.ENABLE): _S.ENABLED,  # 16, where 0x605A lets the drive stay
}


def next_state(state: State, controlword: int, quick_stop_option: int) -> State:
    """The state that a controlword leads to, `state` itself if it commands no transition."""
    command = decode(controlword)
    if command is None:
        return state
    if state is State.QUICK_STOP and command is Command.ENABLE and quick_stop_option < 5:
        return state
    return _TRANSITIONS.get((state, command), state)
