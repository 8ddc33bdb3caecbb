"""The whole CiA 402 table, every state against every controlword."""

from __future__ import annotations

import pytest

from hil_sim.cia402 import State
from hil_sim.cia402.state_machine import Command, decode, next_state

# CiA 402 "command coding": bits 7, 3, 2, 1, 0; x is either.
CODING = {
    Command.SHUTDOWN: "0x110",
    Command.SWITCH_ON: "00111",
    Command.DISABLE_VOLTAGE: "0xx0x",
    Command.QUICK_STOP: "0x01x",
    Command.ENABLE: "01111",
}
S = State
# Rows: state; columns: where each command leads.
TABLE = {
    S.SWITCH_ON_DISABLED: {Command.SHUTDOWN: S.READY},
    S.READY: {
        Command.SWITCH_ON: S.SWITCHED_ON,
        Command.ENABLE: S.ENABLED,
        Command.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        Command.QUICK_STOP: S.SWITCH_ON_DISABLED,
    },
    S.SWITCHED_ON: {
        Command.ENABLE: S.ENABLED,
        Command.SHUTDOWN: S.READY,
        Command.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        Command.QUICK_STOP: S.SWITCH_ON_DISABLED,
    },
    S.ENABLED: {
        Command.SWITCH_ON: S.SWITCHED_ON,
        Command.SHUTDOWN: S.READY,
        Command.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        Command.QUICK_STOP: S.QUICK_STOP,
    },
    S.QUICK_STOP: {Command.DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED},
}


def matches(word, coding):
    bits = [word >> b & 1 for b in (7, 3, 2, 1, 0)]
    return all(c in ("x", str(bit)) for c, bit in zip(coding, bits, strict=True))


def test_every_controlword_is_at_most_one_command():
    for word in range(256):
        expected = [command for command, coding in CODING.items() if matches(word, coding)]
        assert [decode(word)] == (expected or [None]), hex(word)
        assert decode(word | 0xFF00) == decode(word)


@pytest.mark.parametrize("state", State)
def test_transitions(state):
    for word in range(256):
        expected = TABLE.get(state, {}).get(decode(word), state)
        assert next_state(state, word, quick_stop_option=2) is expected, hex(word)


@pytest.mark.parametrize("option", range(9))
def test_quick_stop_can_be_left_by_enable_only_where_the_drive_stays(option):
    left = next_state(State.QUICK_STOP, 0x0F, option) is State.ENABLED
    assert left == (option >= 5)


def test_masks_tell_the_states_apart():
    masks = {
        S.NOT_READY: (0x4F, 0x00), S.SWITCH_ON_DISABLED: (0x4F, 0x40), S.READY: (0x6F, 0x21),
        S.SWITCHED_ON: (0x6F, 0x23), S.ENABLED: (0x6F, 0x27), S.QUICK_STOP: (0x6F, 0x07),
        S.FAULT_REACTION: (0x4F, 0x0F), S.FAULT: (0x4F, 0x08),
    }  # fmt: skip
    for state in State:
        hits = [s for s, (mask, value) in masks.items() if state.value & mask == value]
        assert hits == [state]
