"""CiA 402 device control: states, transitions, commands without effect, faults, modes."""

from __future__ import annotations

from functools import partial

from drivers.commissioning.conformance.probe import Probe
from drivers.drive import TRANSITIONS, Command, State, Status, next_command

_FAULT_OPTION = 1
"""0x6007: loss of the host is a fault."""
_QUIET = 0.05
_MODES = {1: "pp", 3: "pv", 4: "tq", 6: "hm", 7: "ip", 8: "csp", 9: "csv", 10: "cst"}
_RANGE = (0x06090030, 0x06090031)


def _transitions(probe: Probe, with_power: bool) -> None:
    """All transitions by command, each from a state reached by commands."""
    for (origin, command), (number, after) in TRANSITIONS.items():
        powered = State.OPERATION_ENABLED in (origin, after) or origin is State.QUICK_STOP_ACTIVE
        if powered is not with_power or origin is State.FAULT:
            continue
        name = f"transition {number}: {origin} to {after} ({command.name.lower()})"
        if not _lead(probe, origin):
            # with option codes 0..4 the drive leaves by itself, which also is transition 12
            left = origin is State.QUICK_STOP_ACTIVE and probe.state() is State.SWITCH_ON_DISABLED
            probe.expect(name, left, "" if left else f"{origin} not reached: {probe.shown()}")
            continue
        probe.control(command)
        by_itself = (State.SWITCH_ON_DISABLED,) if after is State.QUICK_STOP_ACTIVE else ()
        probe.expect(name, probe.reaches(after, *by_itself))


def _lead(probe: Probe, state: State) -> bool:
    """Takes the drive to a state, one transition at a time; False where that fails."""
    probe.off()
    for _ in range(5):
        present = probe.state()
        if present is state:
            return True
        command = next_command(present, state)
        if command is None:
            return False
        probe.control(command)
        if not probe.reaches(TRANSITIONS[present, command][1]):
            break
    return probe.state() is state


def states(probe: Probe) -> None:
    """Transitions without force, commands that must have no effect, statusword bits."""
    probe.off()
    word = probe.statusword()
    probe.expect("bit 9 (remote) is set", bool(word & Status.REMOTE))
    probe.expect_state("SWITCH ON DISABLED after disable voltage", State.SWITCH_ON_DISABLED)
    for command in (Command.SWITCH_ON, Command.ENABLE_OPERATION):
        probe.control(command)
        probe.network.pump(_QUIET)
        probe.expect_state(
            f"{command.name.lower()} is ignored in SWITCH ON DISABLED", State.SWITCH_ON_DISABLED
        )
        probe.off()
    _transitions(probe, with_power=False)


def modes(probe: Probe) -> None:
    """Mode changes, confirmed by 0x6061."""
    if not probe.offers(0x6061):
        probe.absent("0x6061 confirms mode changes", "0x6061")
        return
    probe.change(0x6060, 0, probe.read(0x6060))
    offered = [m for m in _MODES if probe.supports(m)]
    for mode in offered:
        probe.write(0x6060, 0, mode)
        shown = probe.wait(lambda m=mode: probe.read(0x6061) == m, 1.0)  # type: ignore[misc]
        probe.expect(f"0x6061 shows {_MODES[mode]} ({mode})", shown, f"shows {probe.read(0x6061)}")
    last = probe.read(0x6061)
    for mode in (m for m in _MODES if m not in offered):
        code = probe.abort_code(partial(probe.write, 0x6060, 0, mode))
        probe.network.pump(_QUIET)
        held = probe.read(0x6061) != mode
        name = f"{_MODES[mode]} ({mode}), not in 0x6502, is not entered"
        answer = "accepted" if code is None else f"abort 0x{code:08X}"
        probe.expect(name, held, f"0x6061 shows {mode}, was {last}, {answer}")
    probe.refusal("mode 99 is refused", lambda: probe.write(0x6060, 0, 99), *_RANGE)


def powered_states(probe: Probe) -> None:
    """Transitions to and from OPERATION ENABLED, at rest."""
    if not _choose_mode(probe):
        probe.absent("transitions under force", "no mode known here in 0x6502")
        return
    _transitions(probe, with_power=True)


def _choose_mode(probe: Probe) -> bool:
    """Chooses a mode in which an enabled axis holds its position; False without one."""
    for mode in (1, 6, 8, 3):
        if probe.supports(mode):
            probe.change(0x6060, 0, mode)
            probe.abort_code(lambda: probe.write(0x607A, 0, probe.read(0x6064)))
            return True
    return False


def fault(probe: Probe) -> None:
    """A fault that any drive can have at rest: loss of the heartbeat with 0x6007 = 1."""
    if not (probe.offers(0x6007) and probe.offers(0x1016, 1)):
        probe.absent("fault and its reset", "0x6007 or 0x1016")
        return
    mode = next((m for m in (1, 6, 8) if probe.supports(m)), 1)
    probe.keep_nmt_state_on_host_loss()
    probe.change(0x6007, 0, _FAULT_OPTION)
    if not probe.enable(mode):
        probe.expect("OPERATION ENABLED", False)
        return
    # bit 7 is set before the fault: its level must not acknowledge anything
    probe.control(Command.ENABLE_OPERATION | Command.FAULT_RESET)
    probe.expect_state("bit 7 with enable operation changes nothing", State.OPERATION_ENABLED)
    probe.watch_another_host()
    faulted = probe.reaches(State.FAULT, timeout=3.0)
    probe.expect("heartbeat lost while enabled: FAULT", faulted)
    probe.write(0x1016, 1, 0)
    if not faulted:
        return
    probe.expect("an emergency is sent", any(probe.emergencies), probe.fault_text())
    probe.expect("0x1001 shows an error", bool(probe.read(0x1001) & 1), "generic bit is 0")
    if probe.offers(0x603F):
        probe.expect("0x603F holds a code", probe.read(0x603F) != 0, "is 0")
    if probe.offers(0x1003):
        newest = probe.read(0x1003, 1) & 0xFFFF if probe.read(0x1003) else 0
        same = newest in probe.emergencies
        probe.expect("0x1003:01 is the newest emergency", same, f"is 0x{newest:04X}")
    for word, name in (
        (Command.ENABLE_OPERATION | Command.FAULT_RESET, "the level of bit 7 resets nothing"),
        (Command.DISABLE_VOLTAGE, "nor does its falling edge"),
        (Command.ENABLE_OPERATION, "nor do other commands"),
    ):
        probe.control(word)
        probe.network.pump(_QUIET)
        probe.expect_state(name, State.FAULT)
    probe.control(Command.DISABLE_VOLTAGE)
    probe.control(Command.FAULT_RESET)
    reset = probe.reaches(State.SWITCH_ON_DISABLED)
    probe.expect("the rising edge of bit 7 does (transition 15)", reset)
    probe.expect("0x1001 is clear again", not probe.read(0x1001) & 1, "generic bit is 1")
