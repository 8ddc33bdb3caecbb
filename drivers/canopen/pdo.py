"""PDO mappings, the struct codecs made from them, and their configuration by SDO.

Mapped objects have 8, 16, 32 or 64 bits, as the cyclic objects of CiA 402 do; others are refused.
The order of configuration is that of CiA 301, 7.5.2.36: PDO invalid, count 0, entries, count,
transmission type, PDO valid; then everything is read back.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from struct import Struct

from drivers.canopen.remote_objects import RemoteObjects
from drivers.errors import ConfigurationError, RefusedError
from drivers.objects import ObjectRef, Quantity

RPDO, TPDO = 0x1400, 0x1800
"""Communication records of a drive's first RPDO and TPDO."""
INVALID = 1 << 31
"""COB-ID bit 31: the PDO is not valid."""
NO_RTR = 1 << 30
_CAN_ID = 0x7FF

# CiA 301 data type -> (struct code, bits)
_TYPES: dict[int, tuple[str, int]] = {
    0x02: ("b", 8), 0x03: ("h", 16), 0x04: ("i", 32), 0x15: ("q", 64),
    0x05: ("B", 8), 0x06: ("H", 16), 0x07: ("I", 32), 0x1B: ("Q", 64),
    0x08: ("f", 32), 0x11: ("d", 64),
}  # fmt: skip

SYNCHRONOUS = 1
"""Transmission type: every SYNC."""


@dataclass(frozen=True, slots=True)
class MappedObject:
    """One entry of a PDO mapping.

    Attributes:
        object: what is mapped.  data_type: CiA 301 data type number, as in the EDS.
    """

    object: ObjectRef
    data_type: int

    def __post_init__(self) -> None:
        if self.data_type not in _TYPES:
            raise ConfigurationError(
                f"data type 0x{self.data_type:04X} cannot be a process value "
                "(8, 16, 32 and 64 bit numbers can)",
                obj=self.object,
            )

    @property
    def bits(self) -> int:
        """Width on the bus."""
        return _TYPES[self.data_type][1]

    @property
    def code(self) -> str:
        """Code of the value for `struct` and numpy, without byte order."""
        return _TYPES[self.data_type][0]

    @property
    def entry(self) -> int:
        """The UNSIGNED32 of 0x16xx / 0x1Axx: index, sub-index, length in bits."""
        return self.object.index << 16 | self.object.sub << 8 | self.bits


@dataclass(frozen=True, slots=True)
class PdoMapping:
    """The objects of one PDO in order, and its codec (little-endian, no gaps).

    Attributes:
        entries: the mapped objects, 64 bits at most.
        codec: packs and unpacks one frame's values.
    """

    entries: tuple[MappedObject, ...]
    codec: Struct = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        bits = sum(entry.bits for entry in self.entries)
        if not 0 < bits <= 64:
            raise ConfigurationError(f"a PDO carries 8 to 64 bits, this mapping has {bits}")
        object.__setattr__(self, "codec", Struct("<" + "".join(e.code for e in self.entries)))

    @classmethod
    def of(cls, node: RemoteObjects, refs: Iterable[ObjectRef]) -> PdoMapping:
        """The mapping of these objects, with their data types from the node's EDS."""
        return cls(tuple(MappedObject(ref, node.data_type(ref)) for ref in refs))


def pdo_label(index: int) -> str:
    """The PDO of a communication record, such as "RPDO 1" for 0x1400, "TPDO 1" for 0x1800."""
    return f"{'TPDO' if index >= TPDO else 'RPDO'} {(index & 0x1FF) + 1}"


def _cob_id(index: int) -> ObjectRef:
    """The object with COB-ID and the bits "not valid" (31) and "no RTR" (30)."""
    return ObjectRef(index, 1, f"COB-ID of {pdo_label(index)}", Quantity.CODE)


def disable_pdo(node: RemoteObjects, index: int) -> None:
    """Makes the PDO with this communication record invalid, where the node has it."""
    ref = _cob_id(index)
    value = node.read_if_offered(ref)
    if value is not None and not value & INVALID:
        node.write(ref, value | INVALID)


def configure_pdo(node: RemoteObjects, index: int, cob_id: int, mapping: PdoMapping) -> int:
    """Maps a PDO, makes it synchronous and valid, and reads everything back.

    Args:
        node: whose PDO.
        index: of its communication record; that of its mapping is 0x200 higher.
        cob_id: CAN-ID.
        mapping: its objects.

    Returns:
        Its CAN-ID: another one than asked for where the node has it fixed.

    Raises:
        ConfigurationError: the node holds a value other than the one written.
        NodeError: the node refuses or does not answer.
    """
    cob, code, label = _cob_id(index), Quantity.CODE, pdo_label(index)
    kind = ObjectRef(index, 2, f"{label} transmission", code)
    count = ObjectRef(index + 0x200, 0, f"{label} number of mapped objects", code)
    current = node.read(cob)
    # bit 30 (no RTR) stays as it is: some drives abort a change
    base = cob_id | (current & NO_RTR)
    node.write(cob, current | INVALID)
    node.write(count, 0)
    expected: list[tuple[ObjectRef, int]] = []
    for sub, entry in enumerate(mapping.entries, start=1):
        name = f"{label} mapping of {entry.object}"
        ref = ObjectRef(index + 0x200, sub, name, code)
        node.write(ref, entry.entry)
        expected.append((ref, entry.entry))
    node.write(count, len(mapping.entries))
    node.write(kind, SYNCHRONOUS)
    own = current & ~INVALID
    try:
        node.write(cob, base | INVALID)
    except RefusedError:
        if not current & _CAN_ID:
            raise
        base = own
    node.write(cob, base)
    expected += [(count, len(mapping.entries)), (kind, SYNCHRONOUS), (cob, base)]
    for ref, value in expected:
        held = node.read(ref)
        if ref == cob and held == own and own & _CAN_ID:
            return own & _CAN_ID
        if held != value:
            raise ConfigurationError(
                f"wrote 0x{value:X}, the drive holds 0x{held:X}", axis=node.name, obj=ref
            )
    return base & _CAN_ID
