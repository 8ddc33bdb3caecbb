"""CiA 402 motion: windows and limits, setpoint handshake, halt, cyclic modes, homing.

Setpoints are the actual position: nothing is meant to move.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from drivers.commissioning.conformance.probe import Probe, Verdict
from drivers.drive import Command, Control, State

_ENABLED = int(Command.ENABLE_OPERATION)
_REACHED, _BIT_12, _BIT_13 = (1 << n for n in (10, 12, 13))
_OFF = 0xFFFFFFFF
_HANDSHAKE = 0.5
_VELOCITY = 0x60FF


@dataclass(frozen=True, slots=True)
class _Mode:
    """A mode of operation: its number, its name in findings; whether it has a target velocity."""

    number: int
    name: str
    label: str
    by_velocity: bool = False


_PP, _PV = _Mode(1, "profile position", "pp"), _Mode(3, "profile velocity", "pv", True)
CSP = _Mode(8, "cyclic synchronous position", "mode 8")
CSV = _Mode(9, "cyclic synchronous velocity", "mode 9", True)
_HM = _Mode(6, "homing", "hm")


def settings(probe: Probe) -> None:
    """Windows, limits and option codes read back as written."""
    for index, sub, value, name in (
        (0x6065, 0, 1_000_000, "following error window"),
        (0x6065, 0, _OFF, "following error window off"),
        (0x6066, 0, 20, "following error timeout"),
        (0x6067, 0, 1_000, "position window"),
        (0x6067, 0, _OFF, "position window off"),
        (0x6068, 0, 15, "position window time"),
        (0x605A, 0, 2, "quick stop option: ramp, then disabled"),
        (0x605B, 0, 0, "shutdown option: no ramp"),
        (0x605C, 0, 1, "disable option: ramp"),
        (0x605D, 0, 1, "halt option: ramp"),
        (0x605E, 0, 2, "fault reaction option: quick-stop ramp"),
        (0x6007, 0, 3, "abort connection option: quick stop"),
        (0x60C2, 1, 4, "interpolation period"),
        (0x60C2, 2, -3, "interpolation index"),
    ):
        label = f"0x{index:04X}:{sub:02X} {name} reads back as written"
        if not probe.offers(index, sub):
            probe.absent(label)
            continue
        code = probe.abort_code(partial(probe.change, index, sub, value))
        held = probe.read(index, sub)
        if code is not None:
            probe.note(label, Verdict.DIFFERS, f"{value} refused, abort 0x{code:08X}")
        else:
            probe.expect(label, held == value, f"wrote {value}, reads {held}")


def _is_offered(probe: Probe, mode: _Mode) -> bool:
    """Whether the drive has a mode, with a target velocity of 0; notes where it has not."""
    if not (probe.supports(mode.number) and (not mode.by_velocity or probe.offers(_VELOCITY))):
        return probe.absent(mode.name, "not in 0x6502" + ", or 0x60FF" * mode.by_velocity)
    if mode.by_velocity:
        probe.change(_VELOCITY, 0, 0)
    return True


def _is_enabled(probe: Probe, mode: _Mode) -> bool:
    """Enables the drive in a mode; notes where that fails."""
    return probe.enable(mode.number) or probe.expect(f"enabled in {mode.label}", False)


def profile_position(probe: Probe) -> None:
    """Handshake of controlword bit 4 and statusword bit 12; target reached; halt."""
    if not (_is_offered(probe, _PP) and _is_enabled(probe, _PP)):
        return
    probe.expect("bit 12 is 0 before a setpoint", probe.shows(_BIT_12, 0, _HANDSHAKE))
    probe.write(0x607A, 0, probe.read(0x6064))
    now = _ENABLED | int(Control.CHANGE_IMMEDIATELY)
    probe.control(now | int(Control.NEW_SETPOINT))
    taken = probe.shows(_BIT_12, _BIT_12, _HANDSHAKE)
    if not taken:
        probe.absent("bit 12 rises with bit 4", "drive without acknowledge")
    else:
        probe.note("bit 12 rises with bit 4", Verdict.PASS)
        probe.network.pump(0.1)
        probe.expect("bit 12 stays set as long as bit 4", bool(probe.statusword() & _BIT_12))
        probe.control(now)
        probe.expect("bit 12 falls with bit 4", probe.shows(_BIT_12, 0, _HANDSHAKE))
    probe.control(now)
    probe.expect("bit 10: target reached", probe.shows(_REACHED, _REACHED, 5.0))
    probe.write(0x607A, 0, 0)
    probe.control(now | int(Control.NEW_SETPOINT | Control.RELATIVE))
    accepted = probe.shows(_BIT_12, _BIT_12, _HANDSHAKE) or not taken
    probe.expect("a relative setpoint is accepted", accepted)
    probe.control(now | int(Control.RELATIVE))
    probe.expect("and reached", probe.shows(_REACHED, _REACHED, 5.0))
    probe.control(_ENABLED | int(Control.HALT))
    standing = probe.shows(_REACHED, _REACHED, 2.0) and probe.state() is State.OPERATION_ENABLED
    probe.expect("halt: enabled, bit 10 shows velocity 0", standing)
    probe.control(_ENABLED)


def profile_velocity(probe: Probe) -> None:
    """Target velocity 0 in pv: target reached and speed zero."""
    if _is_offered(probe, _PV) and _is_enabled(probe, _PV):
        both = _REACHED | _BIT_12
        probe.expect("at 0: bit 10 reached, bit 12 speed zero", probe.shows(both, both, 2.0))


def follow(probe: Probe, mode: _Mode) -> None:
    """Actual position as target in csp, velocity 0 in csv: the drive follows the command value."""
    if not _is_offered(probe, mode):
        return
    if probe.offers(0x60C2, 1):
        probe.change(0x60C2, 1, 5)
        probe.change(0x60C2, 2, -3)
    probe.nmt(1)
    if not _is_enabled(probe, mode):
        return
    for _ in range(20):
        probe.network.send_message(0x80, b"")
        probe.network.pump(0.005)
    word = probe.statusword()
    probe.expect("bit 12: follows the command value", bool(word & _BIT_12))
    probe.expect("bit 13: no following error", not word & _BIT_13)


def homing_bits(probe: Probe) -> None:
    """Homing mode before the start: no error, standstill."""
    if _is_offered(probe, _HM) and _is_enabled(probe, _HM):
        standing = probe.shows(_REACHED | _BIT_13, _REACHED, 2.0)
        probe.expect("before the start: bits 13, 10 are 0, 1", standing)


def homing_run(probe: Probe) -> None:
    """Homing at the present position: bits 13, 12, 10 end as 0, 1, 1; start bit cleared."""
    if not _is_offered(probe, _HM):
        return
    for method in (37, 35):
        if probe.abort_code(partial(probe.change, 0x6098, 0, method)) is None:
            break
    else:
        probe.absent("homing at the present position", "methods 37 and 35")
        return
    if not _is_enabled(probe, _HM):
        return
    probe.control(_ENABLED | int(Control.START_HOMING))
    done = probe.shows(_REACHED | _BIT_12 | _BIT_13, _REACHED | _BIT_12, 5.0)
    probe.expect(f"method {method}: bits 13, 12, 10 become 0, 1, 1", done)
    probe.control(_ENABLED)
    probe.network.pump(0.05)
    probe.expect("clearing the start bit is no error", not probe.statusword() & _BIT_13)
