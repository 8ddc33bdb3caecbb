"""CiA 402 motion: windows and limits, setpoint handshake, halt, cyclic modes, homing.

Setpoints are the actual position: nothing is meant to move.
"""

from __future__ import annotations

from collections.abc import Iterator

from drivers.commissioning.conformance.probe import Check, Finding, Probe, Verdict
from drivers.drive import Command, Control, State, Status

_ENABLED = int(Command.ENABLE_OPERATION)
_PP, _PV, _HM, _CSP, _CSV = 1, 3, 6, 8, 9
_REACHED, _BIT_12, _BIT_13 = (
    int(Status.TARGET_REACHED),
    int(Status.SETPOINT_ACKNOWLEDGED),
    int(Status.HOMING_ERROR),
)
_OFF = 0xFFFFFFFF
_HANDSHAKE = 0.5


def settings(probe: Probe) -> Iterator[Finding]:
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
            yield probe.absent(label, "")
            continue
        code = probe.abort_code(lambda i=index, s=sub, v=value: probe.change(i, s, v))  # type: ignore[misc]
        held = probe.read(index, sub)
        if code is not None:
            detail = f"{value} refused, abort 0x{code:08X}"
            yield Finding(probe.group, label, Verdict.DIFFERS, detail)
        else:
            yield probe.expect(label, held == value, f"wrote {value}, reads {held}")


def profile_position(probe: Probe) -> Iterator[Finding]:
    """Handshake of controlword bit 4 and statusword bit 12; target reached; halt."""
    if not probe.supports(_PP):
        yield probe.absent("profile position", "not in 0x6502")
        return
    if not probe.enable(_PP):
        yield probe.expect("enabled in pp", False, probe.shown())
        return

    def bit(mask: int, level: bool, timeout: float = _HANDSHAKE) -> bool:
        return probe.wait(lambda: bool(probe.statusword() & mask) is level, timeout)

    yield probe.expect("bit 12 is 0 before a setpoint", bit(_BIT_12, False), probe.shown())
    probe.write(0x607A, 0, probe.read(0x6064))
    now = _ENABLED | int(Control.CHANGE_IMMEDIATELY)
    probe.control(now | int(Control.NEW_SETPOINT))
    taken = bit(_BIT_12, True)
    if not taken:
        yield probe.absent("bit 12 rises with bit 4", "drive without acknowledge")
    else:
        yield probe.expect("bit 12 rises with bit 4", True, "")
        probe.network.pump(0.1)
        stays = bool(probe.statusword() & _BIT_12)
        yield probe.expect("bit 12 stays set as long as bit 4", stays, probe.shown())
        probe.control(now)
        yield probe.expect("bit 12 falls with bit 4", bit(_BIT_12, False), probe.shown())
    probe.control(now)
    yield probe.expect("bit 10: target reached", bit(_REACHED, True, 5.0), probe.shown())
    probe.write(0x607A, 0, 0)
    probe.control(now | int(Control.NEW_SETPOINT | Control.RELATIVE))
    accepted = bit(_BIT_12, True) or not taken
    yield probe.expect("a relative setpoint is accepted", accepted, probe.shown())
    probe.control(now | int(Control.RELATIVE))
    yield probe.expect("and reached", bit(_REACHED, True, 5.0), probe.shown())
    probe.control(_ENABLED | int(Control.HALT))
    standing = bit(_REACHED, True, 2.0) and probe.state() is State.OPERATION_ENABLED
    yield probe.expect("halt: enabled, bit 10 shows velocity 0", standing, probe.shown())
    probe.control(_ENABLED)


def profile_velocity(probe: Probe) -> Iterator[Finding]:
    """Target velocity 0 in pv: target reached and speed zero."""
    if not (probe.supports(_PV) and probe.offers(0x60FF)):
        yield probe.absent("profile velocity", "not in 0x6502, or 0x60FF")
        return
    probe.change(0x60FF, 0, 0)
    if not probe.enable(_PV):
        yield probe.expect("enabled in pv", False, probe.shown())
        return
    both = _REACHED | _BIT_12
    still = probe.wait(lambda: probe.statusword() & both == both, 2.0)
    yield probe.expect("at 0: bit 10 reached, bit 12 speed zero", still, probe.shown())


def cyclic_velocity(probe: Probe) -> Iterator[Finding]:
    """Target velocity 0 in csv: the drive follows the command value."""
    if not (probe.supports(_CSV) and probe.offers(0x60FF)):
        yield probe.absent("cyclic synchronous velocity", "not in 0x6502, or 0x60FF")
        return
    probe.change(0x60FF, 0, 0)
    yield from _cyclic(probe, _CSV)


def cyclic_position(probe: Probe) -> Iterator[Finding]:
    """Actual position as target in csp: the drive follows the command value."""
    if not probe.supports(_CSP):
        yield probe.absent("cyclic synchronous position", "not in 0x6502")
        return
    yield from _cyclic(probe, _CSP)


def _cyclic(probe: Probe, mode: int) -> Iterator[Finding]:
    if probe.offers(0x60C2, 1):
        probe.change(0x60C2, 1, 5)
        probe.change(0x60C2, 2, -3)
    probe.nmt(1)
    if not probe.enable(mode):
        yield probe.expect(f"enabled in mode {mode}", False, probe.shown())
        return
    for _ in range(20):
        probe.network.send_message(0x80, b"")
        probe.network.pump(0.005)
    word = probe.statusword()
    yield probe.expect("bit 12: follows the command value", bool(word & _BIT_12), probe.shown())
    yield probe.expect("bit 13: no following error", not word & _BIT_13, probe.shown())


def homing_bits(probe: Probe) -> Iterator[Finding]:
    """Homing mode before the start: no error, standstill."""
    if not probe.supports(_HM):
        yield probe.absent("homing", "not in 0x6502")
        return
    if not probe.enable(_HM):
        yield probe.expect("enabled in hm", False, probe.shown())
        return
    standing = probe.wait(lambda: probe.statusword() & (_REACHED | _BIT_13) == _REACHED, 2.0)
    yield probe.expect("before the start: bits 13, 10 are 0, 1", standing, probe.shown())


def homing_run(probe: Probe) -> Iterator[Finding]:
    """Homing at the present position: bits 13, 12, 10 end as 0, 1, 1; start bit cleared."""
    if not probe.supports(_HM):
        yield probe.absent("homing", "not in 0x6502")
        return
    method = next(
        (m for m in (37, 35) if probe.abort_code(lambda m=m: probe.change(0x6098, 0, m)) is None),  # type: ignore[misc]
        None,
    )
    if method is None:
        yield probe.absent("homing at the present position", "methods 37 and 35")
        return
    if not probe.enable(_HM):
        yield probe.expect("enabled in hm", False, probe.shown())
        return
    probe.control(_ENABLED | int(Control.START_HOMING))
    mask = _REACHED | _BIT_12 | _BIT_13
    done = probe.wait(lambda: probe.statusword() & mask == _REACHED | _BIT_12, 5.0)
    yield probe.expect(f"method {method}: bits 13, 12, 10 become 0, 1, 1", done, probe.shown())
    probe.control(_ENABLED)
    probe.network.pump(0.05)
    still = not probe.statusword() & _BIT_13
    yield probe.expect("clearing the start bit is no error", still, probe.shown())


GROUPS: list[tuple[str, Check]] = [
    ("settings", settings),
    ("profile position", profile_position),
    ("profile velocity", profile_velocity),
    ("csp", cyclic_position),
    ("csv", cyclic_velocity),
    ("homing", homing_bits),
]
HOMING_GROUPS: list[tuple[str, Check]] = [("homing run", homing_run)]
