"""Frames on a CANopen bus in words, by the predefined connection set and the nodes' EDS files.

What a PDO holds is followed (`pdo_maps`): SDO writes to mappings are heard like everything else.
Nothing is sent, unless the nodes are asked for mappings and units first (`read_nodes`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from canopen import ObjectDictionaryError, SdoAbortedError
from canopen.objectdictionary import INTEGER_TYPES, ODVariable

from drivers.canopen import (
    NMT_COMMANDS,
    NMT_STATES,
    Network,
    Node,
    Value,
    error_text,
    load_dictionary,
    register_text,
)
from drivers.commissioning.object_values import meaning, raw_text, reference, without_unit
from drivers.commissioning.pdo_maps import Pdo, PdoMaps
from drivers.drive import check_units
from drivers.errors import ConfigurationError, NodeError
from drivers.objects import SYNC_ID, ObjectRef
from drivers.settings import HOST_NODE, AxisSettings

_CODES = {0x1001, 0x603F, 0x6040, 0x6041, 0x6060, 0x6061}
"""Objects whose change is an event; other process values change all the time."""
_FOR_ALL = {0x000: "NMT", 0x100: "TIME"}
_PDOS = range(0x180, 0x501)
_READ, _WRITTEN, _ABORTED = 0x40, 0x60, 0x80
_SERVICE, _EXPEDITED, _SIZED = 0xE0, 0x02, 0x01


@dataclass(frozen=True, slots=True)
class Decoded:
    """A frame in words.

    Attributes:
        who: the axis, "node 5", "host" or "all".
        service: such as "TPDO 1", "SDO", "EMCY".
        text: what it says.
        state: of a frame that repeats, what makes one differ from the last (its codes); else None.
    """

    who: str
    service: str
    text: str
    state: tuple[int, ...] | None = None


class _Known:
    """A node whose EDS is known."""

    def __init__(self, settings: AxisSettings) -> None:
        self.settings = settings
        self.units: AxisSettings | None = settings
        self.dictionary = load_dictionary(settings)
        self.maps = PdoMaps(self.dictionary)
        self.writing: tuple[int, int, int] | None = None


class FrameDecoder:
    """Decodes frames in the order in which they were on the bus.

    Args:
        axes: with node ids, EDS files and units.

    Raises:
        ConfigurationError: an EDS cannot be read.
    """

    def __init__(self, axes: Sequence[AxisSettings]) -> None:
        self._nodes = {axis.node: _Known(axis) for axis in axes}

    def read_nodes(self, network: Network) -> list[str]:
        """Reads mappings and units from the nodes by SDO.

        Returns:
            One line for each node that does not answer, whose mappings stay those of its EDS, and
            for each whose units are not those of the settings: its values stay as they are.

        Raises:
            BusError: the bus fails.
        """
        notes = []
        for known in self._nodes.values():
            node = Node(network, known.settings)
            try:
                try:
                    check_units(node, known.settings)
                except ConfigurationError as other:
                    known.units = None
                    notes.append(f"{other}; its values are shown in the drive's units")
                known.maps.read(node)
            except NodeError:
                known.maps.reset()
                notes.append(
                    f"axis {node.name}: node {node.id} does not answer; its PDOs are taken to be "
                    f"those of {known.settings.eds.name}"
                )
            finally:
                node.detach()
        return notes

    def decode(self, can_id: int, data: bytes) -> Decoded:
        """A data frame with an 11-bit id in words."""
        function, node = can_id & 0x780, can_id & 0x7F
        if can_id == 0 and len(data) == 2:
            command = NMT_COMMANDS.get(data[0], f"unknown command {data[0]}")
            return Decoded(self._name(data[1]), "NMT", command)
        if can_id == SYNC_ID:
            return Decoded("all", "SYNC", str(data[0]) if data else "", ())
        if can_id in _FOR_ALL:
            return Decoded("all", _FOR_ALL[can_id], data.hex(" "))
        for known in self._nodes.values():
            pdo = known.maps.by_id.get(can_id)
            if pdo is not None:
                return self._process_data(known, pdo, data)
        who = self._name(node)
        if function == 0x080:
            return Decoded(who, "EMCY", _emergency(data))
        if function in (0x580, 0x600):
            return Decoded(who, "SDO", self._sdo(node, data, request=function == 0x600))
        if function == 0x700 and len(data) == 1:
            return self._heartbeat(node, data[0] & 0x7F)
        if function in _PDOS:
            label = f"{'TPDO' if function & 0x80 else 'RPDO'} {(function - 0x80) >> 8}"
            return Decoded(who, label, f"{data.hex(' ')} (not mapped)", ())
        return Decoded("", f"0x{can_id:03X}", data.hex(" "))

    def _name(self, node: int) -> str:
        if node == 0:
            return "all"
        if node in self._nodes:
            return self._nodes[node].settings.name
        return "host" if node == HOST_NODE else f"node {node}"

    def _heartbeat(self, node: int, state: int) -> Decoded:
        if state == 0 and node in self._nodes:
            self._nodes[node].maps.reset()
        text = NMT_STATES.get(state, f"unknown state {state}")
        return Decoded(self._name(node), "heartbeat", text, (state,))

    def _process_data(self, known: _Known, pdo: Pdo, data: bytes) -> Decoded:
        name = known.settings.name
        if len(data) != pdo.size:
            text = f"{data.hex(' ')} ({len(data)} bytes, {pdo.size} are mapped)"
            return Decoded(name, pdo.label, text, ())
        values = list(_split(pdo, data))
        text = ", ".join(_with_name(known, *place, part) for place, part in values)
        codes = tuple(
            int.from_bytes(part, "little") for (index, _), part in values if index in _CODES
        )
        return Decoded(name, pdo.label, text, codes)

    # -- SDO --------------------------------------------------------------------------------

    def _sdo(self, node: int, data: bytes, request: bool) -> str:
        if len(data) != 8:
            return data.hex(" ")
        command, index, sub = struct.unpack_from("<BHB", data)
        known = self._nodes.get(node)
        obj = _reference(known, index, sub)
        if command == _ABORTED:
            code = int.from_bytes(data[4:], "little")
            text = SdoAbortedError.CODES.get(code, "no abort code of CiA 301")
            by = "client" if request else "server"
            return f"{obj} aborted by the {by}: {text} (0x{code:08X})"
        service = command & _SERVICE
        if request and service == _READ:
            return f"read {obj}"
        if request and service == 0x20:
            return self._write_request(known, obj, command, data)
        if not request and service == _READ:
            if not command & _EXPEDITED:
                return f"{obj} has {int.from_bytes(data[4:], 'little')} bytes, in segments"
            return f"{obj} = {_text(known, obj, _payload(command, data))}"
        if not request and service == _WRITTEN:
            self._written(known, obj)
            return f"{obj} written"
        return f"segment or block {data.hex(' ')}"

    def _write_request(
        self, known: _Known | None, obj: ObjectRef, command: int, data: bytes
    ) -> str:
        if not command & _EXPEDITED:
            return f"write {obj}, {int.from_bytes(data[4:], 'little')} bytes in segments"
        payload = _payload(command, data)
        if known is not None:
            known.writing = obj.index, obj.sub, int.from_bytes(payload, "little")
        return f"write {obj} = {_text(known, obj, payload)}"

    def _written(self, known: _Known | None, obj: ObjectRef) -> None:
        if known is not None and known.writing is not None:
            if known.writing[:2] == (obj.index, obj.sub):
                known.maps.note(*known.writing)
            known.writing = None


def _emergency(data: bytes) -> str:
    if len(data) != 8:
        return data.hex(" ")
    code, register = struct.unpack_from("<HB", data)
    if not code:
        return "no error any more"
    return f"{error_text(code)}, error register: {register_text(register)}"


def _payload(command: int, data: bytes) -> bytes:
    return data[4 : 8 - (command >> 2 & 3)] if command & _SIZED else data[4:]


def _split(pdo: Pdo, data: bytes) -> Iterator[tuple[tuple[int, int], bytes]]:
    """Each object of a frame with its bytes; parts of bytes are shifted into place."""
    whole, at = int.from_bytes(data, "little"), 0
    for index, sub, bits in pdo.entries:
        part = whole >> at & (1 << bits) - 1
        yield (index, sub), part.to_bytes((bits + 7) // 8, "little")
        at += bits


def _with_name(known: _Known, index: int, sub: int, data: bytes) -> str:
    obj = _reference(known, index, sub)
    raw, words = _raw_and_words(known, obj, data)
    if not obj.name:
        return f"0x{index:04X}:{sub:02X} {raw}"
    if words is None:
        return f"{obj.name} {raw}"
    return f"{without_unit(obj.name)} {_joined(obj, raw, words)}"


def _variable(known: _Known | None, index: int, sub: int) -> ODVariable | None:
    return None if known is None else known.dictionary.get_variable(index, sub)


def _reference(known: _Known | None, index: int, sub: int) -> ObjectRef:
    variable = _variable(known, index, sub)
    return ObjectRef(index, sub, "") if variable is None else reference(variable)


def _text(known: _Known | None, obj: ObjectRef, data: bytes) -> str:
    return _joined(obj, *_raw_and_words(known, obj, data))


def _joined(obj: ObjectRef, raw: str, words: str | None) -> str:
    """Codes by number and in words; of other values the SI value, where there is one."""
    if words is None:
        return raw
    return f"{raw} ({words})" if obj.index in _CODES else words


def _raw_and_words(known: _Known | None, obj: ObjectRef, data: bytes) -> tuple[str, str | None]:
    """A value as the drive holds it, and its meaning."""
    variable = _variable(known, obj.index, obj.sub)
    value: Value = int.from_bytes(data, "little")
    bits = 8 * len(data)
    if variable is not None and (variable.data_type not in INTEGER_TYPES or len(variable) == bits):
        try:
            value = variable.decode_raw(data)
        except ObjectDictionaryError:
            value = data
    return raw_text(obj, value, bits), meaning(obj, value, None if known is None else known.units)
