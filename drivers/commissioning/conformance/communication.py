"""CiA 301: identity, abort codes, NMT, heartbeat, PDO mapping and SYNC."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

from canopen import SdoAbortedError

from drivers.canopen import NMT_STATES
from drivers.commissioning.conformance.probe import OTHER_HOST, Probe, Verdict
from drivers.drive import Command, State

_ABSENT_OBJECT, _ABSENT_SUB = 0x06020000, 0x06090011
_READ_ONLY, _UNSUPPORTED = 0x06010002, 0x06010000
_LENGTH = (0x06070010, 0x06070012)
_NOT_MAPPABLE, _TOO_LONG = 0x06040041, 0x06040042
_INVALID, _NO_RTR = 1 << 31, 1 << 30
_ENTRIES = 8
"""Most that a mapping of whole bytes can have."""
_BEAT_MS = 50
_MAPPED_STATUSWORD, _MAPPED_POSITION, _MAPPED_CONTROLWORD = 0x60410010, 0x60640020, 0x60400010
_MANDATORY = {0x6040: "controlword", 0x6041: "statusword", 0x6060: "mode"}
_OPTIONAL = (
    (0x6007, 0, "abort connection option"),
    (0x603F, 0, "error code"),
    (0x6061, 0, "mode display"),
    (0x6077, 0, "torque actual value"),
    (0x608F, 1, "factor group"),
    (0x60B2, 0, "torque offset"),
    (0x60C2, 1, "interpolation period"),
    (0x60F4, 0, "following error"),
    (0x6502, 0, "modes offered"),
)


def identity(probe: Probe) -> None:
    """Mandatory objects and their values."""
    kind = probe.read(0x1000)
    probe.expect("0x1000 names profile 402", kind & 0xFFFF == 402, f"is 0x{kind:08X}")
    code = probe.abort_code(lambda: probe.read(0x1001))
    probe.expect("0x1001 can be read", code is None, f"abort 0x{code or 0:08X}")
    vendor = probe.read(0x1018, 1)
    probe.expect("0x1018:01 holds a vendor", vendor != 0, "is 0")
    for index, name in _MANDATORY.items():
        code = probe.abort_code(partial(probe.read, index))
        probe.expect(f"0x{index:04X} {name} is there", code is None, f"abort 0x{code or 0:X}")
    for index, sub, name in _OPTIONAL:
        verdict = Verdict.PASS if probe.offers(index, sub) else Verdict.ABSENT
        probe.note(f"0x{index:04X} {name} is there", verdict)


def abort_codes(probe: Probe) -> None:
    """Accesses that have to be refused, and their abort codes."""
    read, write, refusal = probe.channel.upload, probe.channel.download, probe.refusal
    refusal("read of an absent object", lambda: read(0x1FFF, 0), _ABSENT_OBJECT)
    refusal("write of an absent object", lambda: write(0x1FFF, 0, b"\0"), _ABSENT_OBJECT)
    refusal("read of an absent sub-index", lambda: read(0x1018, 200), _ABSENT_SUB)
    refusal("write of the statusword", lambda: write(0x6041, 0, b"\0\0"), _READ_ONLY)
    refusal("write of the device type", lambda: write(0x1000, 0, bytes(4)), _READ_ONLY)
    refusal("controlword of four bytes", lambda: write(0x6040, 0, bytes(4)), *_LENGTH)
    if probe.offers(0x1008):
        plain, block = read(0x1008, 0), probe.channel.block_upload(0x1008, 0)
        both = f"{plain.hex(' ')}, {block.hex(' ')}"
        probe.expect("block and plain upload agree", plain == block, both)


def network_management(probe: Probe) -> None:
    """NMT states shown by the heartbeat, boot-up, heartbeats produced and consumed."""
    _restore_communication(probe)
    probe.change(0x1017, 0, _BEAT_MS)
    for command, state in ((1, 5), (2, 4), (128, 127)):
        probe.nmt(command)
        probe.beats.clear()
        probe.network.pump(3.5 * _BEAT_MS * 1e-3)
        shown = {s for _, s in probe.beats}
        name = f"heartbeat shows {NMT_STATES[state].upper()}"
        probe.expect(name, shown == {state}, f"shows {sorted(shown)}")
    probe.beats.clear()
    probe.network.pump(20.5 * _BEAT_MS * 1e-3)
    count = len(probe.beats)
    probe.expect(f"20 heartbeats of {_BEAT_MS} ms a second", 17 <= count <= 22, f"{count} a second")
    _heartbeat_consumer(probe)
    probe.beats.clear()
    probe.nmt(130)
    booted = probe.wait(lambda: any(s == 0 for _, s in probe.beats), 2.0)
    probe.expect("boot-up message after reset communication", booted, "none within 2 s")


def _restore_communication(probe: Probe) -> None:
    """Notes for `Probe.restore` what "reset communication" discards of another host's setup."""
    for index in (*range(0x1400, 0x1404), *range(0x1800, 0x1804)):
        if probe.offers(index, 1):
            _restore_pdos(probe, index)
    consumers = [(0x1016, s) for s in range(1, 5)]
    # restored in reverse: 0x1019 must not change while 0x1006 is not 0
    for index, sub in ((0x1005, 0), (0x1006, 0), (0x1007, 0), (0x1019, 0), (0x1029, 1), *consumers):
        if probe.offers(index, sub):
            probe.restore_later(index, sub)


def _heartbeat_consumer(probe: Probe) -> None:
    name = "EMCY 0x8130 when a watched heartbeat ends"
    if not probe.offers(0x1016, 1):
        probe.absent(name, "0x1016")
        return
    probe.keep_nmt_state_on_host_loss()
    probe.watch_another_host()
    heard = probe.wait(lambda: 0x8130 in probe.emergencies, 1.0)
    probe.expect(name, heard, probe.fault_text())
    probe.network.send_message(0x700 + OTHER_HOST, b"\x05")
    probe.write(0x1016, 1, 0)


def mapping(probe: Probe) -> None:
    """Mapping in the order of CiA 301, 7.5.2.36, and what has to be refused during it."""
    _restore_pdos(probe, 0x1800, 0x1400)
    base = (0x180 + probe.node) | (probe.read(0x1800, 1) & _NO_RTR)
    _invalidate(probe, 0x1800)
    probe.refusal("entry while there is a count", lambda: _entry_under_count(probe), _UNSUPPORTED)
    probe.write(0x1A00, 0, 0)
    for name, entries, codes in (
        ("mapping of an absent object", [0x1FFF0008], (_ABSENT_OBJECT, _NOT_MAPPABLE)),
        ("mapping of 0x1018:01", [0x10180120], (_NOT_MAPPABLE,)),
        ("mapping of the statusword as an RPDO", None, (_NOT_MAPPABLE,)),
        ("more than 64 bits", [_MAPPED_POSITION] * 3, (_TOO_LONG,)),
    ):
        if entries is None:
            probe.refusal(name, lambda: _map_rpdo(probe, _MAPPED_STATUSWORD), *codes)
        else:
            probe.refusal(name, partial(_map, probe, 0x1A00, *entries), *codes)
            probe.write(0x1A00, 0, 0)
    _map(probe, 0x1A00, _MAPPED_STATUSWORD, _MAPPED_POSITION)
    probe.write(0x1800, 2, 1)
    probe.write(0x1800, 1, base)
    held = [probe.read(0x1A00, s) for s in range(3)]
    same = held == [2, _MAPPED_STATUSWORD, _MAPPED_POSITION]
    probe.expect("the mapping reads back", same, " ".join(f"{v:X}" for v in held))
    probe.refusal("mapping while the PDO is valid", lambda: probe.write(0x1A00, 0, 0), _UNSUPPORTED)
    _synchronous(probe)
    _latch(probe)


def _entry_under_count(probe: Probe) -> None:
    probe.write(0x1A00, 0, 0)
    _map(probe, 0x1A00, _MAPPED_STATUSWORD)
    probe.write(0x1A00, 1, _MAPPED_POSITION)


def _map_rpdo(probe: Probe, entry: int) -> None:
    _invalidate(probe, 0x1400)
    probe.write(0x1600, 0, 0)
    _map(probe, 0x1600, entry)


def _invalidate(probe: Probe, communication: int) -> None:
    cob = probe.read(communication, 1)
    if not cob & _INVALID:
        probe.write(communication, 1, cob | _INVALID)


def _map(probe: Probe, index: int, *entries: int) -> None:
    for sub, entry in enumerate(entries, start=1):
        probe.write(index, sub, entry)
    probe.write(index, 0, len(entries))


def _sync(probe: Probe, count: int) -> list[bytes]:
    """The TPDOs after a number of SYNCs, 5 ms apart."""
    probe.tpdos.clear()
    for _ in range(count):
        probe.network.send_message(0x80, b"")
        probe.network.pump(0.005)
    probe.network.pump(0.02)
    return [data for can_id, data in probe.tpdos if can_id == 0x180 + probe.node]


def _synchronous(probe: Probe) -> None:
    frames = _sync(probe, 3)
    probe.expect("no TPDO while PRE-OPERATIONAL", not frames, f"{len(frames)} came")
    probe.nmt(1)
    frames = _sync(probe, 6)
    good = len(frames) == 6 and all(len(f) == 6 for f in frames)
    name = "type 1: a TPDO of six bytes for every SYNC"
    if probe.expect(name, good, f"6 SYNCs: {len(frames)} frames"):
        word, position = struct.unpack("<Hi", frames[-1])
        same = word == probe.statusword() and abs(position - probe.read(0x6064)) < 10_000
        probe.expect("the TPDO holds what SDO reads", same, f"0x{word:04X}, {position}")
    cob = probe.read(0x1800, 1)
    probe.write(0x1800, 1, cob | _INVALID)
    probe.write(0x1800, 2, 3)
    probe.write(0x1800, 1, cob)
    frames = _sync(probe, 6)
    count = f"6 SYNCs: {len(frames)} frames"
    probe.expect("type 3: a TPDO for every third SYNC", len(frames) == 2, count)


def _latch(probe: Probe) -> None:
    """A synchronous RPDO takes effect at the SYNC, not before."""
    probe.nmt(128)
    cob = probe.read(0x1400, 1)
    _map_rpdo(probe, _MAPPED_CONTROLWORD)
    probe.write(0x1400, 2, 1)
    probe.write(0x1400, 1, (0x200 + probe.node) | (cob & _NO_RTR))
    probe.off()
    probe.nmt(1)
    probe.network.send_message(0x200 + probe.node, struct.pack("<H", Command.SHUTDOWN))
    probe.network.pump(0.05)
    probe.expect_state("a synchronous RPDO waits for the SYNC", State.SWITCH_ON_DISABLED)
    _sync(probe, 2)
    probe.expect("and takes effect at it", probe.reaches(State.READY_TO_SWITCH_ON))
    probe.nmt(128)


@dataclass(frozen=True, slots=True)
class _PdoSetup:
    """A PDO's parameters, saved and restored.

    All are read before any is changed: while the count is 0, some drives show no entries or lose
    them.

    Attributes:
        index: of its communication record; that of its mapping is 0x200 higher.
        cob_id, kind: sub-indices 1 and 2 of the former.  entries: of the latter.
        spare: entries beyond their number, which have no effect, as far as the drive shows them.
    """

    index: int
    cob_id: int
    kind: int
    entries: tuple[int, ...]
    spare: tuple[int, ...]

    @classmethod
    def read(cls, probe: Probe, index: int) -> _PdoSetup:
        """The parameters in the drive; raises as `Probe.read`."""
        count = probe.read(index + 0x200, 0)
        return cls(
            index,
            probe.read(index, 1),
            probe.read(index, 2),
            tuple(probe.read(index + 0x200, sub) for sub in range(1, count + 1)),
            tuple(_spare(probe, index + 0x200, count)),
        )

    def restore(self, probe: Probe) -> str:
        """Restores the parameters where they differ; returns what the drive did not accept."""
        index, mapping = self.index, self.index + 0x200
        if _PdoSetup.read(probe, index) == self:
            return ""
        for step in (
            (index, 1, self.cob_id | _INVALID),
            (mapping, 0, 0),
            *((mapping, sub, v) for sub, v in enumerate(self.entries + self.spare, start=1)),
            (mapping, 0, len(self.entries)),
            (index, 2, self.kind),
            (index, 1, self.cob_id),
        ):
            probe.abort_code(partial(probe.write, *step))
        held = _PdoSetup.read(probe, index)
        if replace(held, spare=self.spare) == self:
            return ""
        return f"0x{index:04X} has {held.text()}, had {self.text()}"

    def text(self) -> str:
        """The parameters on one line."""
        entries = " ".join(f"{entry:08X}" for entry in self.entries) or "nothing"
        return f"COB-ID 0x{self.cob_id:08X}, type {self.kind}, {entries} mapped"


def _spare(probe: Probe, mapping: int, count: int) -> Iterator[int]:
    try:
        for sub in range(count + 1, _ENTRIES + 1):
            yield probe.read(mapping, sub)
    except SdoAbortedError:
        return


def _restore_pdos(probe: Probe, *communication: int) -> None:
    """Has `Probe.restore` restore these PDOs (index 0x14xx or 0x18xx); raises as `Probe.read`."""
    for index in communication:
        probe.on_restore(partial(_PdoSetup.read(probe, index).restore, probe))
