"""The drive's object dictionary: objects and defaults from the EDS, values in one process image.

The process image holds decoded values in a plain dict by `key(index, subindex)`; the modes read it
and the PDO engine packs and unpacks it directly. SDO access goes through `get_data` and `set_data`,
which check access type, length and range and answer with the abort codes of CiA 301. An object may
be `live` (computed when read), have a `check` (may refuse a value) and an `on_write` (acts on it).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from canopen import ObjectDictionary, SdoAbortedError, import_od
from canopen.objectdictionary import NUMBER_TYPES, ODVariable
from canopen.sdo import constants as abort

Value = int | float | str | bytes

EDS_PATH = Path(__file__).parents[1] / "eds" / "stagectl-linear-drive.eds"
"""The drive as it is at power-on, with the default mappings of CiA 402."""
CSP_DCF_PATH = EDS_PATH.with_name("stagectl-linear-drive-csp.dcf")
"""The same with one synchronous PDO each way, as stagectl's own driver maps it."""

COMMUNICATION_AREA = range(0x1000 << 8, 0x2000 << 8)  # what NMT "reset communication" resets


def key(index: int, subindex: int = 0) -> int:
    """An object's key in the process image."""
    return index << 8 | subindex


def name(key_: int) -> str:
    """The object in the usual notation, `0x6099:01`."""
    return f"0x{key_ >> 8:04X}:{key_ & 0xFF:02X}"


def require(condition: object, code: int = abort.ABORT_INVALID_VALUE) -> None:
    """Refuse an SDO access with this abort code unless the condition holds."""
    if not condition:
        raise SdoAbortedError(code)


def require_length(length: int, expected: int) -> None:
    """Refuse a value that is longer or shorter than its object."""
    require(length <= expected, abort.ABORT_LENGTH_TOO_HIGH)
    require(length >= expected, abort.ABORT_LENGTH_TOO_LOW)


@functools.cache
def load_eds(node_id: int) -> ObjectDictionary:
    """The EDS with `$NODEID` resolved; shared, never written."""
    return import_od(str(EDS_PATH), node_id=node_id)


class Dictionary:
    """Objects of one node.

    Args:
        node_id: 1..127, resolves `$NODEID` in the EDS.
        parameters: defaults of this unit in place of the EDS' (limits, gains, rated force), by key.

    Attributes:
        object_dictionary: the objects, with types and access; canopen's SdoServer reads it.
        values: the process image, decoded values by key.
        live: by key, a function that returns the present value; takes precedence over `values`.
        check: by key, called with a new value before it is stored; may raise `SdoAbortedError`.
        on_write: by key, called after a value has been stored, by SDO or RPDO.
        act_last: keys whose `on_write` runs after that of all other objects of a SYNC or frame, in
            this order.

    Raises:
        ValueError: a parameter that the EDS does not have.
    """

    def __init__(self, node_id: int, parameters: dict[int, Value] | None = None) -> None:
        self.object_dictionary = load_eds(node_id)
        self.variables: dict[int, ODVariable] = {}
        for entry in self.object_dictionary.values():
            members = [entry] if isinstance(entry, ODVariable) else entry.values()
            for variable in members:
                self.variables[key(variable.index, variable.subindex)] = variable
        self._defaults: dict[int, Value] = {
            k: variable.default if variable.default is not None else 0
            for k, variable in self.variables.items()
        }
        unknown = (parameters or {}).keys() - self.variables.keys()
        if unknown:
            raise ValueError(f"{name(min(unknown))}: not an object of {EDS_PATH.name}")
        self._defaults.update(parameters or {})
        self.values: dict[int, Value] = {}
        self.live: dict[int, Callable[[], int]] = {}
        self.check: dict[int, Callable[[int], None]] = {}
        self.on_write: dict[int, Callable[[int], None]] = {}
        self.act_last: tuple[int, ...] = ()
        self.reset_all()

    def preset(self, values: dict[int, int]) -> None:
        """Sets other values after power-on, which this is, of those objects that there are."""
        self._defaults.update({k: v for k, v in values.items() if k in self.variables})
        self.reset_all()

    def reset_all(self) -> None:
        """Set every value to its power-on value."""
        self.values.update(self._defaults)

    def reset_communication(self) -> None:
        """Set objects 0x1000 to 0x1FFF to their power-on values."""
        self.values.update({k: v for k, v in self._defaults.items() if k in COMMUNICATION_AREA})

    def integer(self, key_: int) -> int:
        """The value of an integer object."""
        return self.values[key_]  # type: ignore[return-value]

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """Read and encode a value.

        Raises:
            SdoAbortedError: absent, write-only, or refused by the object itself.
        """
        variable = self._find(index, subindex)
        require(variable.readable or not check_readable, abort.ABORT_READ_WRITEONLY)
        k = key(index, subindex)
        read = self.live.get(k)
        return bytes(variable.encode_raw(self.values[k] if read is None else read()))

    def set_data(
        self, index: int, subindex: int, data: bytes, check_writable: bool = False
    ) -> None:
        """Decode, check and store a value, then act on it.

        Raises:
            SdoAbortedError: absent, read-only, wrong length, out of range, or refused.
        """
        variable = self._find(index, subindex)
        if check_writable:
            self.check_writable(index, subindex)
        if variable.data_type in NUMBER_TYPES:
            require_length(8 * len(data), len(variable))
        value: Any = variable.decode_raw(bytes(data))
        k = key(index, subindex)
        self.check_value(k, value)
        self.values[k] = value
        on_write = self.on_write.get(k)
        if on_write is not None:
            on_write(value)

    def check_value(self, k: int, value: Any) -> None:
        """Raise `SdoAbortedError` unless the object accepts the value."""
        variable = self.variables[k]
        require(variable.max is None or value <= variable.max, abort.ABORT_VALUE_TOO_HIGH)
        require(variable.min is None or value >= variable.min, abort.ABORT_VALUE_TOO_LOW)
        check = self.check.get(k)
        if check is not None:
            check(value)

    def check_writable(self, index: int, subindex: int) -> None:
        """Raise `SdoAbortedError` unless a client may write the object."""
        require(self._find(index, subindex).writable, abort.ABORT_WRITE_READONLY)

    def mappable(self, index: int, subindex: int, bits: int, receive: bool) -> ODVariable:
        """The object of a PDO mapping entry.

        Raises:
            SdoAbortedError: absent (0x06020000, 0x06090011), or not for this PDO (0x06040041).
        """
        variable = self._find(index, subindex)
        direction = variable.writable if receive else variable.readable
        fits = variable.pdo_mappable and direction and bits == len(variable)
        require(fits, abort.ABORT_PDO_CANNOT_MAP)
        return variable

    def _find(self, index: int, subindex: int) -> ODVariable:
        variable = self.variables.get(key(index, subindex))
        if variable is None:
            raise SdoAbortedError(
                abort.ABORT_NO_SUBINDEX
                if index in self.object_dictionary
                else abort.ABORT_NOT_IN_OD
            )
        return variable
