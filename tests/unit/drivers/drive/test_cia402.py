"""CiA 402 states, transitions and controlwords against the printed tables."""

import itertools

import pytest

from drivers.drive.cia402 import (
    AUTOMATIC,
    HOLD,
    TRANSITIONS,
    Command,
    State,
    decode,
    next_command,
    next_controlword,
)

HELD = {
    State.SWITCH_ON_DISABLED: 0x00,
    State.READY_TO_SWITCH_ON: 0x06,
    State.SWITCHED_ON: 0x07,
    State.OPERATION_ENABLED: 0x0F,
    State.QUICK_STOP_ACTIVE: 0x02,
}
"""States that can be commanded, and the controlword that keeps a drive in each."""
REACHABLE = list(HELD)

# From CiA 402-2, table of statuswords, "x" for bits outside the state; written as printed there.
PRINTED = {
    State.NOT_READY_TO_SWITCH_ON: "xxxxxxxxx0xx0000",
    State.SWITCH_ON_DISABLED: "xxxxxxxxx1xx0000",
    State.READY_TO_SWITCH_ON: "xxxxxxxxx01x0001",
    State.SWITCHED_ON: "xxxxxxxxx01x0011",
    State.OPERATION_ENABLED: "xxxxxxxxx01x0111",
    State.QUICK_STOP_ACTIVE: "xxxxxxxxx00x0111",
    State.FAULT_REACTION_ACTIVE: "xxxxxxxxx0xx1111",
    State.FAULT: "xxxxxxxxx0xx1000",
}


def matches(word, pattern):
    return all(p in ("x", b) for p, b in zip(pattern, f"{word:016b}", strict=True))


def test_decode_agrees_with_the_printed_table_for_every_statusword():
    for word in (high | low for high in (0x0000, 0x0200, 0xFF00) for low in range(0x100)):
        shown = [s for s, pattern in PRINTED.items() if matches(word, pattern)]
        assert len(shown) <= 1
        assert decode(word) is (shown[0] if shown else State.NOT_READY_TO_SWITCH_ON)


def test_the_transition_table_is_complete():
    """All numbers of CiA 402-2, figure 6; 0, 13 and 16 are not the host's (see the module)."""
    numbers = {n for n, _ in TRANSITIONS.values()} | {n for n, _ in AUTOMATIC.values()}
    assert numbers == set(range(17)) - {0, 13, 16}
    ends = {
        2: "SWITCH_ON_DISABLED READY_TO_SWITCH_ON", 3: "READY_TO_SWITCH_ON SWITCHED_ON",
        4: "SWITCHED_ON OPERATION_ENABLED", 5: "OPERATION_ENABLED SWITCHED_ON",
        6: "SWITCHED_ON READY_TO_SWITCH_ON", 7: "READY_TO_SWITCH_ON SWITCH_ON_DISABLED",
        8: "OPERATION_ENABLED READY_TO_SWITCH_ON", 9: "OPERATION_ENABLED SWITCH_ON_DISABLED",
        10: "SWITCHED_ON SWITCH_ON_DISABLED", 11: "OPERATION_ENABLED QUICK_STOP_ACTIVE",
        12: "QUICK_STOP_ACTIVE SWITCH_ON_DISABLED", 15: "FAULT SWITCH_ON_DISABLED",
    }  # fmt: skip
    for (origin, _), (number, after) in TRANSITIONS.items():
        assert ends[number] == f"{origin.name} {after.name}"


@pytest.mark.parametrize(("state", "target"), list(itertools.product(State, REACHABLE)))
def test_every_target_is_reached_from_every_state(state, target):
    """A drive that obeys the table arrives, and a fault is reset by an edge."""
    word, edge = 0, False
    for _ in range(12):
        if state is target:
            return
        before, word = word, next_controlword(state, target, word)
        edge = bool(word & 0x80 and not before & 0x80)
        if state in AUTOMATIC:
            state = AUTOMATIC[state][1]
        elif state is State.FAULT:
            state = State.SWITCH_ON_DISABLED if edge else state
        else:
            state = TRANSITIONS[state, Command(word)][1]
    pytest.fail(f"stays in {state}")


def test_enabling_takes_shutdown_switch_on_enable_operation():
    words = [next_controlword(s, State.OPERATION_ENABLED) for s in REACHABLE[:3]]
    assert words == [0x06, 0x07, 0x0F]


def test_a_drive_is_not_enabled_directly_from_quick_stop():
    assert next_command(State.QUICK_STOP_ACTIVE, State.OPERATION_ENABLED) is Command.DISABLE_VOLTAGE


def test_a_set_fault_reset_bit_is_cleared_before_the_next_edge():
    target = State.SWITCH_ON_DISABLED
    words = [0x80]
    for _ in range(3):
        words.append(next_controlword(State.FAULT, target, words[-1]))
    assert words == [0x80, 0x00, 0x80, 0x00]


def test_nothing_is_commanded_until_the_fault_reaction_ends():
    assert next_command(State.FAULT_REACTION_ACTIVE, State.SWITCH_ON_DISABLED) is None
    assert next_controlword(State.FAULT_REACTION_ACTIVE, State.SWITCH_ON_DISABLED, 0x8F) == 0x0F


@pytest.mark.parametrize(
    "target", [State.FAULT, State.FAULT_REACTION_ACTIVE, State.NOT_READY_TO_SWITCH_ON]
)
def test_a_fault_cannot_be_commanded(target):
    with pytest.raises(ValueError, match="cannot be commanded"):
        next_controlword(State.OPERATION_ENABLED, target)


def test_holding_controlwords_cause_no_transition():
    for state, word in HOLD.items():
        if state is not State.SWITCH_ON_DISABLED:
            assert (state, Command(word)) not in TRANSITIONS
    assert HOLD[State.OPERATION_ENABLED] == 0x0F


@pytest.mark.parametrize("previous", [0x0000, 0x0006, 0x0080, 0x010F])
@pytest.mark.parametrize(("state", "word"), HELD.items())
def test_a_state_that_is_reached_is_held_whatever_was_sent_last(state, word, previous):
    assert next_controlword(state, state, previous) == word


@pytest.mark.parametrize("state", [State.FAULT, State.FAULT_REACTION_ACTIVE])
def test_in_a_commanded_fault_state_the_controlword_stays(state):
    assert next_controlword(state, state, 0x0006) == 0x0006


def test_the_previous_controlword_defaults_to_zero():
    assert next_controlword(State.NOT_READY_TO_SWITCH_ON, State.SWITCH_ON_DISABLED) == 0x0000
