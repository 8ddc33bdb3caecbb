"""The node under test: object access with the sizes of CiA 402, waiting, findings.

Checks note their findings here. Groups of checks run one after the other; each begins with the
drive disabled, in PRE-OPERATIONAL and with its original parameter values.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from canopen import SdoAbortedError

from drivers.canopen import Network, SdoChannel, error_text
from drivers.drive import Command, State, decode

_CODES = {
    **dict.fromkeys((0x6060, 0x6061, 0x6098), "b"),
    **dict.fromkeys((0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6077, 0x60B2), "h"),
    **dict.fromkeys((0x6064, 0x607A, 0x607D, 0x60FF), "i"),
    **dict.fromkeys((0x1001, 0x1019, 0x1029), "B"),
    **dict.fromkeys((0x1017, 0x603F, 0x6040, 0x6041, 0x6066, 0x6068, 0x6072), "H"),
}
"""`struct` format code of an object's type in CiA 301 or 402; the others are UNSIGNED32."""
_RECORDS = (0x1003, 0x1016, 0x1018, 0x607D)
_MODE = 0x6060
OTHER_HOST = 126
"""Node whose heartbeat the drive is made to watch."""
STATE_TIMEOUT = 1.0


class Verdict(StrEnum):
    """Result of a check."""

    PASS = "pass"  # noqa: S105  no password
    FAIL = "FAIL"
    DIFFERS = "differs"
    ABSENT = "not offered"


@dataclass(frozen=True, slots=True)
class Finding:
    """One row of the table of results.

    Attributes:
        group: of the check.  check: what was expected.  verdict: its result.
        detail: what the drive did instead, empty if it passed.
    """

    group: str
    check: str
    verdict: Verdict
    detail: str = ""


def code_of(index: int, sub: int) -> str:
    """`struct` format code of an object's type in CiA 301 or 402; UNSIGNED32 by default."""
    pdo = index & 0xF000 == 0x1000 and index >> 8 & 0xF in (4, 6, 8, 0xA)
    if sub == 0 and (pdo or index in _RECORDS):
        return "B"
    if pdo and sub == 2 and index >> 8 & 0xF in (4, 8):
        return "B"
    if index == 0x60C2 and sub:
        return "B" if sub == 1 else "b"
    return _CODES.get(index, "I")


class Probe:
    """A node that is being checked.

    Args:
        network: on a bus that nothing else reads from and no other host uses.
        node: 1..126.
        on_finding: called with each finding as it is made.

    Attributes:
        channel: SDO access to its objects.
        group: name of the present group, for findings.
        findings: made so far.
        emergencies: EMCY codes received.  beats: (time [ns], NMT state) of every heartbeat.
        tpdos: (CAN-ID, data) of every TPDO of this node.
    """

    def __init__(
        self, network: Network, node: int, on_finding: Callable[[Finding], object] = lambda _: None
    ) -> None:
        self.network = network
        self.node = node
        self.group = ""
        self.findings: list[Finding] = []
        self._on_finding = on_finding
        self.emergencies: list[int] = []
        self.beats: list[tuple[int, int]] = []
        self.tpdos: list[tuple[int, bytes]] = []
        self.channel = SdoChannel(network, node)
        self._undo: list[Callable[[], str]] = []
        self._subscriptions = [
            (0x80 + node, self._on_emergency),
            (0x700 + node, self._on_heartbeat),
            *((0x180 + 0x100 * n + node, self._on_tpdo) for n in range(4)),
        ]
        for can_id, callback in self._subscriptions:
            network.subscribe(can_id, callback)

    def close(self) -> None:
        """Stops listening."""
        for can_id, callback in self._subscriptions:
            self.network.unsubscribe(can_id, callback)
        self.channel.detach()

    def _on_emergency(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == 8:
            self.emergencies.append(struct.unpack_from("<H", data)[0])

    def _on_heartbeat(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == 1:
            self.beats.append((self.network.clock.now_ns(), data[0] & 0x7F))

    def _on_tpdo(self, can_id: int, data: bytearray, timestamp: float) -> None:
        self.tpdos.append((can_id, bytes(data)))

    # -- objects ----------------------------------------------------------------------------

    def read(self, index: int, sub: int = 0) -> int:
        """The value of an object.

        Raises:
            SdoAbortedError: refused.
            SdoCommunicationError: no answer.
        """
        data = self.channel.upload(index, sub)
        code = code_of(index, sub)
        return int.from_bytes(data[: struct.calcsize(code)], "little", signed=code.islower())

    def write(self, index: int, sub: int, value: int) -> None:
        """Writes an object; raises as `read`."""
        self.channel.download(index, sub, struct.pack("<" + code_of(index, sub), value))

    def change(self, index: int, sub: int, value: int) -> None:
        """Writes an object whose original value `restore` restores; raises as `read`."""
        self.restore_later(index, sub)
        self.write(index, sub, value)

    def restore_later(self, index: int, sub: int = 0) -> None:
        """Has `restore` restore the present value of an object; raises as `read`."""
        before = self.read(index, sub)
        self.on_restore(lambda: self._restore_value(index, sub, before))

    @property
    def changed(self) -> bool:
        """Whether something is still to be restored."""
        return bool(self._undo)

    def on_restore(self, action: Callable[[], str]) -> None:
        """Has `restore` call an action, which returns what the drive did not accept, or ""."""
        self._undo.append(action)

    def _restore_value(self, index: int, sub: int, before: int) -> str:
        if self.read(index, sub) == before:
            return ""
        self.abort_code(lambda: self.write(index, sub, before))
        held = self.read(index, sub)
        if held == before or (index == _MODE and before == 0):  # 0: no mode was requested
            return ""
        return f"0x{index:04X}:{sub:02X} holds {held}, was {before}"

    def offers(self, index: int, sub: int = 0) -> bool:
        """Whether the object can be read."""
        return self.abort_code(lambda: self.channel.upload(index, sub)) is None

    def abort_code(self, action: Callable[[], object]) -> int | None:
        """The SDO abort code of an access; None if the drive accepts it."""
        try:
            action()
        except SdoAbortedError as refused:
            return refused.code
        return None

    def keep_nmt_state_on_host_loss(self) -> None:
        """Sets 0x1029:01 to 1 where the drive offers it, so that SDO remains available."""
        self.abort_code(lambda: self.change(0x1029, 1, 1))

    def watch_another_host(self) -> None:
        """Makes the drive watch the heartbeat of `OTHER_HOST`, which sends a single one."""
        self.emergencies.clear()
        self.change(0x1016, 1, OTHER_HOST << 16 | 100)
        self.network.send_message(0x700 + OTHER_HOST, b"\x05")

    def restore(self) -> list[str]:
        """Restores all changes, the latest first.

        Returns:
            What the drive did not accept.

        Raises:
            SdoCommunicationError: no answer; the rest is still to be restored.
        """
        refused = []
        while self._undo:
            try:
                refused.append(self._undo[-1]())
            except SdoAbortedError as abort:
                refused.append(f"SDO abort: {abort}")
            self._undo.pop()
        return [text for text in refused if text]

    # -- states -----------------------------------------------------------------------------

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Receives until `condition`, checked every 5 ms, holds; False after `timeout` [s]."""
        deadline = self.network.clock.now_ns() + round(timeout * 1e9)
        while not condition():
            if self.network.clock.now_ns() >= deadline:
                return False
            self.network.pump(0.005)
        return True

    def statusword(self) -> int:
        """0x6041."""
        return self.read(0x6041)

    def state(self) -> State:
        """The power state."""
        return decode(self.statusword())

    def control(self, word: int) -> None:
        """Writes 0x6040."""
        self.write(0x6040, 0, word)

    def reaches(self, *states: State, timeout: float = STATE_TIMEOUT) -> bool:
        """Whether the drive shows one of the states within `timeout` [s]."""
        return self.wait(lambda: self.state() in states, timeout)

    def shows(self, mask: int, bits: int, timeout: float) -> bool:
        """Whether the statusword has these bits under a mask within `timeout` [s]."""
        return self.wait(lambda: self.statusword() & mask == bits, timeout)

    def nmt(self, command: int) -> None:
        """Sends an NMT command to this node."""
        self.network.send_message(0, bytes((command, self.node)))
        self.network.pump(0.02)

    def off(self) -> None:
        """Takes the drive to SWITCH ON DISABLED from any state; acknowledges a fault."""
        if self.state() in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            self.reaches(State.FAULT)
            self.control(Command.DISABLE_VOLTAGE)
            self.control(Command.FAULT_RESET)
        self.control(Command.DISABLE_VOLTAGE)
        self.reaches(State.SWITCH_ON_DISABLED)

    def enable(self, mode: int) -> bool:
        """Takes the drive to OPERATION ENABLED in a mode, at its actual position."""
        self.off()
        self.change(0x6060, 0, mode)
        if not self.wait(lambda: self.read(0x6061) == mode, STATE_TIMEOUT):
            return False
        self.abort_code(lambda: self.write(0x607A, 0, self.read(0x6064)))
        for word, state in (
            (Command.SHUTDOWN, State.READY_TO_SWITCH_ON),
            (Command.SWITCH_ON, State.SWITCHED_ON),
            (Command.ENABLE_OPERATION, State.OPERATION_ENABLED),
        ):
            self.control(word)
            if not self.reaches(state):
                return False
        return True

    def supports(self, mode: int) -> bool:
        """Whether 0x6502 lists a mode (1..10)."""
        return self.offers(0x6502) and bool(self.read(0x6502) >> (mode - 1) & 1)

    # -- findings ---------------------------------------------------------------------------

    def note(self, name: str, verdict: Verdict, detail: str = "") -> None:
        """Notes a finding of the present group."""
        finding = Finding(self.group, name, verdict, detail)
        self.findings.append(finding)
        self._on_finding(finding)

    def expect(self, name: str, held: bool, found: str | None = None) -> bool:
        """Notes pass, or fail with what was found, by default the state; returns `held`."""
        if found is None:
            found = self.shown()
        self.note(name, Verdict.PASS if held else Verdict.FAIL, "" if held else found)
        return held

    def expect_state(self, name: str, state: State) -> None:
        """Notes whether the drive is in a state."""
        self.expect(name, self.state() is state)

    def absent(self, name: str, why: str = "") -> bool:
        """Notes: not offered; returns False."""
        self.note(name, Verdict.ABSENT, why)
        return False

    def refusal(self, name: str, action: Callable[[], object], *codes: int) -> None:
        """Notes pass if refused with one of the codes, differs with another, else fail."""
        code = self.abort_code(action)
        expected = " or ".join(f"0x{c:08X}" for c in codes)
        if code in codes:
            self.note(name, Verdict.PASS)
        elif code is None:
            self.note(name, Verdict.FAIL, f"accepted, not aborted ({expected})")
        else:
            text = SdoAbortedError.CODES.get(code, "no abort code of CiA 301")
            self.note(name, Verdict.DIFFERS, f"abort 0x{code:08X} ({text}), not {expected}")

    def shown(self) -> str:
        """Statusword and state as text."""
        word = self.statusword()
        return f"statusword 0x{word:04X} ({decode(word)})"

    def fault_text(self) -> str:
        """The last emergency as text."""
        if not self.emergencies:
            return "no emergency"
        return f"emergency {error_text(self.emergencies[-1])}"
