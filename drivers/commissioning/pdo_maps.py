"""What the PDOs of a node hold: by its EDS, as read from it, and as changed on the bus since.

A boot-up message brings the values of the EDS back, as a reset does in the drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import canopen
from canopen.objectdictionary import ODVariable

from drivers.canopen import RemoteObjects, pdo_label
from drivers.errors import RefusedError
from drivers.objects import ObjectRef

_AREA = range(0x1400, 0x1C00)
_INVALID = 1 << 31


@dataclass(frozen=True, slots=True)
class Pdo:
    """One valid PDO.

    Attributes:
        label: such as "RPDO 1".
        entries: index, sub-index and bits of the objects that it carries, in order.
    """

    label: str
    entries: tuple[tuple[int, int, int], ...]

    @property
    def size(self) -> int:
        """Bytes of a frame."""
        return (sum(bits for _, _, bits in self.entries) + 7) // 8


class PdoMaps:
    """The PDOs of one node.

    Attributes:
        by_id: the valid ones by CAN-ID.
    """

    def __init__(self, dictionary: canopen.ObjectDictionary) -> None:
        self._defaults: dict[tuple[int, int], int] = {}
        for index in dictionary:
            record = dictionary[index]
            if index not in _AREA or isinstance(record, ODVariable):
                continue
            for variable in record.values():
                value = variable.default if variable.value is None else variable.value
                if isinstance(value, int):
                    self._defaults[index, variable.subindex] = value
        self._held: dict[tuple[int, int], int] = {}
        self.by_id: dict[int, Pdo] = {}
        self.reset()

    def reset(self) -> None:
        """Back to the values of the EDS."""
        self._held = dict(self._defaults)
        self._update()

    def note(self, index: int, sub: int, value: int) -> None:
        """Takes over a value that the node has accepted; without effect outside 0x1400..0x1BFF."""
        if index in _AREA:
            self._held[index, sub] = value
            self._update()

    def read(self, node: RemoteObjects) -> None:
        """Reads all of them from the node; what it does not have is not valid.

        Raises:
            NodeError: no answer.
        """
        for communication in sorted({index for index, _ in self._defaults if not index & 0x200}):
            mapping = communication + 0x200
            try:
                cob_id = node.read(ObjectRef(communication, 1, "COB-ID"))
                count = node.read(ObjectRef(mapping, 0, "number of mapped objects"))
                self._held[mapping, 0] = count
                for sub in range(1, min(count, 8) + 1):
                    self._held[mapping, sub] = node.read(ObjectRef(mapping, sub, "mapped object"))
                self._held[communication, 1] = cob_id
            except RefusedError:
                self._held[communication, 1] = _INVALID
        self._update()

    def _update(self) -> None:
        self.by_id = {}
        for (index, sub), cob_id in self._held.items():
            if sub != 1 or index & 0x200 or cob_id & _INVALID:
                continue
            count = self._held.get((index + 0x200, 0), 0)
            entries = [self._held.get((index + 0x200, s), 0) for s in range(1, count + 1)]
            self.by_id[cob_id & 0x7FF] = Pdo(
                pdo_label(index), tuple((e >> 16, e >> 8 & 0xFF, e & 0xFF) for e in entries)
            )
