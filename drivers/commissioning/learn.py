"""What a drive without power says of itself and takes: facts for a profile, nothing moves.

Needs no EDS. Objects are read; where only trying shows it (modes, heartbeat, notation of 0x60C2),
values are written and restored. What cannot be determined is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import Network
from drivers.commissioning.conformance.probe import Probe
from drivers.drive import State
from drivers.errors import NodeError

MODES = {1: "pp", 3: "pv", 6: "hm", 8: "csp", 9: "csv", 10: "cst"}
_OPTIONAL = (
    0x1006, 0x1007, 0x1019, 0x6007, 0x603F, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6061,
    0x6065, 0x6066, 0x6067, 0x6068, 0x6072, 0x6076, 0x6077, 0x607C, 0x607E, 0x6085, 0x6098,
    0x609A, 0x60B2, 0x60F2, 0x60FD, 0x6502,
)  # fmt: skip
"""Objects that the host uses where they are there."""
_NOT_THERE = (0x06020000, 0x06090011)
_POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
_HEARTBEATS = (100, 200, 500, 1000)
"""Periods that are tried [ms]; the first is the host's own."""
_SHOWN = 0.5
"""Time in which 0x6061 may show a mode [s]."""
_MOST_PDOS, _MOST_ENTRIES = 8, 8


@dataclass(frozen=True, slots=True)
class Learnt:
    """A fact: key of a drive profile, its value, and the access that shows it."""

    key: str
    value: object
    source: str


def learn(network: Network, node: int) -> tuple[list[Learnt], list[str]]:
    """Reads and tries a node.

    Args:
        network: of the bus, which nothing else reads and no other host uses.
        node: 1..126.

    Returns:
        What was learned; and what the drive did not take back, one clause each.

    Raises:
        NodeError: the node does not answer, is no CiA 402 drive, or is under power.
        BusError: the bus fails.
    """
    probe = Probe(network, node)
    try:
        found = _facts(probe)
    except SdoCommunicationError as silence:
        raise NodeError(f"node {node} does not answer SDO") from silence
    except SdoAbortedError as refused:
        raise NodeError(f"node {node} refuses what has to be read: {refused}") from refused
    finally:
        refusals = _restored(probe)
        probe.close()
    return found, refusals


def _restored(probe: Probe) -> list[str]:
    try:
        return probe.restore()
    except SdoCommunicationError:
        return ["no SDO answer: what was tried may still be set"] if probe.changed else []


def _facts(probe: Probe) -> list[Learnt]:
    if probe.read(0x1000) & 0xFFFF != 402:
        raise NodeError(f"node {probe.node} is no CiA 402 drive (0x1000)")
    if (state := probe.state()) in _POWERED:
        raise NodeError(f"node {probe.node} is in {state}: disable it first")
    long = len(probe.channel.upload(0x6041, 0)) == 4
    found = [
        Learnt(key, value, f"0x1018:{sub:02X} read")
        for sub, key in ((1, "vendor"), (2, "product"), (3, "revision"))
        if (value := _value(probe, 0x1018, sub)) is not None
    ]
    found.append(Learnt("long_answers", long, "0x6041 read"))
    absent = [index for index in _OPTIONAL if _is_absent(probe, index)]
    found += [Learnt("absent", absent, "read, refused as not there")] if absent else []
    for index, key in ((0x6502, "modes_claimed"), (0x60A8, "position_unit"),
                       (0x60A9, "velocity_unit"), (0x60AA, "acceleration_unit")):  # fmt: skip
        value = _value(probe, index)
        found += [Learnt(key, value, f"0x{index:04X} read")] if value else []
    for index, key in ((0x60B2, "offset_bits"), (0x6077, "force_bits")) if not long else ():
        size = _size(probe, index)
        found += [Learnt(key, 8 * size, f"0x{index:04X} read")] if size in (2, 4) else []
    found += _pdos(probe)
    for trial in (_modes, _heartbeat, _notation):
        found += trial(probe)
    return found


def _is_absent(probe: Probe, index: int) -> bool:
    return probe.abort_code(lambda: probe.channel.upload(index, 0)) in _NOT_THERE


def _size(probe: Probe, index: int) -> int:
    try:
        return len(probe.channel.upload(index, 0))
    except SdoAbortedError:
        return 0


def _value(probe: Probe, index: int, sub: int = 0) -> int | None:
    try:
        return probe.read(index, sub)
    except SdoAbortedError:
        return None


def _pdos(probe: Probe) -> list[Learnt]:
    tpdos = next((n for n in range(_MOST_PDOS) if not probe.offers(0x1800 + n, 1)), _MOST_PDOS)
    entries = next((n for n in range(_MOST_ENTRIES) if not probe.offers(0x1A00, n + 1)), 0)
    found = [Learnt("tpdos", tpdos, "0x1800 and on read")] if 0 < tpdos < _MOST_PDOS else []
    return found + ([Learnt("pdo_entries", entries, "0x1A00 read")] if entries else [])


def _modes(probe: Probe) -> list[Learnt]:
    """Modes that 0x6060 takes and 0x6061 shows, or does not show without power."""
    probe.restore_later(0x6060)
    works = []
    for mode, name in MODES.items():
        if probe.abort_code(partial(probe.write, 0x6060, 0, mode)) is not None:
            continue
        shown = probe.wait(lambda m=mode: _value(probe, 0x6061) == m, _SHOWN)  # type: ignore[misc]
        if shown or (not _value(probe, 0x6061) and probe.read(0x6060) == mode):
            works.append(name)
    return [Learnt("modes", works, "taken by 0x6060, not contradicted by 0x6061")] if works else []


def _heartbeat(probe: Probe) -> list[Learnt]:
    """The shortest period that the drive takes, where that is not the host's own."""
    probe.restore_later(0x1017)
    for period in _HEARTBEATS:
        if probe.abort_code(partial(probe.write, 0x1017, 0, period)) is None:
            if probe.read(0x1017) == period:
                usual = period == _HEARTBEATS[0]
                return [] if usual else [Learnt("heartbeat", period / 1000, "0x1017 written")]
    return []


def _notation(probe: Probe) -> list[Learnt]:
    """Whether 0x60C2:02 takes no other power of ten than the present one."""
    present = _value(probe, 0x60C2, 2)
    if present is None:
        return []
    probe.restore_later(0x60C2, 2)
    for other in (-4, -3, -2):
        refused = probe.abort_code(partial(probe.write, 0x60C2, 2, other)) is not None
        if other != present and not refused and probe.read(0x60C2, 2) == other:
            return []
    return [Learnt("only", {"0x60C2:02": present}, "others written, not taken")]
