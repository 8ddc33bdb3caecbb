"""PDO mappings, the struct codecs made from them, and their configuration by SDO.

Mapped objects have 8, 16, 32 or 64 bits, as the cyclic objects of CiA 402 do; others are refused.
The order of configuration is that of CiA 301, 7.5.2.36: PDO invalid, count 0, entries, count,
transmission type, PDO valid; then everything is read back.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from struct import Struct
from typing import Protocol

from drivers.errors import ConfigurationError
from drivers.objects import ObjectRef, Quantity

INVALID = 1 << 31
"""COB-ID bit 31: the PDO is not valid."""
NO_RTR = 1 << 30

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


class ObjectAccess(Protocol):
    """Access to the objects of one node (implemented by `Node`)."""

    name: str

    def read(self, obj: ObjectRef) -> int:
        """The value of an integer object."""

    def write(self, obj: ObjectRef, value: int) -> None:
        """Writes an integer object."""

    def offers(self, obj: ObjectRef) -> bool:
        """Whether the node has the object."""


@dataclass(frozen=True, slots=True)
class PdoRecord:
    """Communication and mapping parameters of one PDO of a node.

    Attributes:
        communication: index, from 0x1400 or 0x1800.  mapping: index, from 0x1600 or 0x1A00.
        label: for messages, such as "RPDO 1".
    """

    communication: int
    mapping: int
    label: str

    @classmethod
    def receive(cls, number: int) -> PdoRecord:
        """The drive's RPDO `number` (from 1)."""
        return cls(0x1400 + number - 1, 0x1600 + number - 1, f"RPDO {number}")

    @classmethod
    def transmit(cls, number: int) -> PdoRecord:
        """The drive's TPDO `number` (from 1)."""
        return cls(0x1800 + number - 1, 0x1A00 + number - 1, f"TPDO {number}")

    def cob_id(self) -> ObjectRef:
        """The object with COB-ID and the bits "not valid" (31) and "no RTR" (30)."""
        return ObjectRef(self.communication, 1, f"COB-ID of {self.label}", Quantity.CODE)

    def disable(self, node: ObjectAccess) -> None:
        """Makes the PDO invalid, where the node has it."""
        ref = self.cob_id()
        if not node.offers(ref):
            return
        value = node.read(ref)
        if not value & INVALID:
            node.write(ref, value | INVALID)

    def configure(
        self, node: ObjectAccess, cob_id: int, mapping: PdoMapping, transmission: int = SYNCHRONOUS
    ) -> None:
        """Maps the PDO, sets its transmission type, makes it valid, and reads everything back.

        Raises:
            ConfigurationError: the node holds a value other than the one written.
            NodeError: the node refuses or does not answer.
        """
        cob, code = self.cob_id(), Quantity.CODE
        kind = ObjectRef(self.communication, 2, f"{self.label} transmission", code)
        count = ObjectRef(self.mapping, 0, f"{self.label} number of mapped objects", code)
        current = node.read(cob)
        # bit 30 (no RTR) stays as it is: some drives abort a change
        base = cob_id | (current & NO_RTR)
        node.write(cob, (current & ~0x1FFFFFFF) | INVALID | (current & 0x1FFFFFFF))
        node.write(count, 0)
        expected: list[tuple[ObjectRef, int]] = []
        for sub, entry in enumerate(mapping.entries, start=1):
            name = f"{self.label} mapping of {entry.object}"
            ref = ObjectRef(self.mapping, sub, name, code)
            node.write(ref, entry.entry)
            expected.append((ref, entry.entry))
        node.write(count, len(mapping.entries))
        node.write(kind, transmission)
        node.write(cob, base | INVALID)
        node.write(cob, base)
        expected += [(count, len(mapping.entries)), (kind, transmission), (cob, base)]
        for ref, value in expected:
            held = node.read(ref)
            if held != value:
                raise ConfigurationError(
                    f"wrote 0x{value:X}, the drive holds 0x{held:X}", axis=node.name, obj=ref
                )
