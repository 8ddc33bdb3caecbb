"""What RPDO and TPDO of the virtual drive share: parameters, mapping, packing (CiA 301).

The mapping is changed in the order that CiA 301 demands: PDO invalid (bit 31), count 0, entries,
count, PDO valid. Not supported: RTR (252, 253), dummy entries, multiplexed PDOs. A PDO that is made
valid with nothing mapped does nothing. Bit 30 (no RTR) is stored as written, because some masters
clear it without ever requesting by RTR.
"""

from __future__ import annotations

import struct
from typing import Any

from canopen.objectdictionary import datatypes
from canopen.sdo import constants as abort

from hil_sim.cia301.object_dictionary import Dictionary, key, require

_ENTRIES = range(1, 9)
_INVALID, _NO_RTR, _EXTENDED = 1 << 31, 1 << 30, 1 << 29
_SYNCHRONOUS = range(241)
EVENT = (254, 255)

_CODES = {
    datatypes.INTEGER8: "b", datatypes.UNSIGNED8: "B",
    datatypes.INTEGER16: "h", datatypes.UNSIGNED16: "H",
    datatypes.INTEGER32: "i", datatypes.UNSIGNED32: "I",
    datatypes.INTEGER64: "q", datatypes.UNSIGNED64: "Q",
    datatypes.REAL32: "f", datatypes.REAL64: "d",
}  # fmt: skip


def _is_restricted(cob_id: int) -> bool:
    """Whether CiA 301 reserves this COB-ID, so that no PDO may use it."""
    return (
        cob_id < 0x081
        or 0x101 <= cob_id <= 0x180
        or 0x581 <= cob_id <= 0x5FF
        or 0x601 <= cob_id <= 0x67F
        or 0x6E0 <= cob_id
    )


class Pdo:
    """What RPDO and TPDO share: parameters, mapping rules, codec."""

    receive: bool

    def __init__(self, dictionary: Dictionary, communication: int, mapping: int) -> None:
        self.dictionary = dictionary
        self.mapping = mapping
        self.cob_key = key(communication, 1)
        self.type_key = key(communication, 2)
        self.cob_id = 0
        self.valid = False
        self.transmission = 1
        self.keys: tuple[int, ...] = ()
        self.codec = struct.Struct("<")
        check = dictionary.check
        check[self.cob_key] = self._check_cob
        check[self.type_key] = lambda value: require(value in _SYNCHRONOUS or value in EVENT)
        check[key(mapping, 0)] = self._check_count
        for sub in _ENTRIES:
            check[key(mapping, sub)] = self._check_entry

    def compile(self) -> None:
        """Read the parameters from the dictionary."""
        values = self.dictionary
        cob = values.integer(self.cob_key)
        self.cob_id = cob & 0x7FF
        self.transmission = values.integer(self.type_key)
        variables = [
            self._variable(values.integer(key(self.mapping, sub)))
            for sub in range(1, values.integer(key(self.mapping, 0)) + 1)
        ]
        self.keys = tuple(key(v.index, v.subindex) for v in variables)
        self.codec = struct.Struct("<" + "".join(_CODES[v.data_type] for v in variables))
        self.valid = not cob & _INVALID and bool(self.keys)

    def _variable(self, entry: int) -> Any:
        return self.dictionary.mappable(
            entry >> 16, entry >> 8 & 0xFF, entry & 0xFF, receive=self.receive
        )

    def exists(self) -> bool:
        """Whether it is valid (bit 31), with or without anything mapped."""
        return not self.dictionary.integer(self.cob_key) & _INVALID

    def _check_cob(self, value: int) -> None:
        identifier = value & 0x1FFFFFFF
        changed = value ^ self.dictionary.integer(self.cob_key)
        require(not self.exists() or value & _INVALID or not changed & ~_NO_RTR)
        require(not value & _EXTENDED and identifier <= 0x7FF)
        require(value & _INVALID or not _is_restricted(identifier))

    def _check_entry(self, value: int) -> None:
        count = self.dictionary.integer(key(self.mapping, 0))
        require(not self.exists() and not count, abort.ABORT_UNSUPPORTED_ACCESS)
        if value:
            self._variable(value)

    def _check_count(self, value: int) -> None:
        require(not self.exists(), abort.ABORT_UNSUPPORTED_ACCESS)
        require(value <= len(_ENTRIES), abort.ABORT_PDO_LENGTH_EXCEEDED)
        entries = [self.dictionary.integer(key(self.mapping, s)) for s in range(1, value + 1)]
        for entry in entries:
            self._variable(entry)  # an empty entry is an absent object
        bits = sum(entry & 0xFF for entry in entries)
        require(bits <= 64, abort.ABORT_PDO_LENGTH_EXCEEDED)
