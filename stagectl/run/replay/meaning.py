"""A frame between the host and its axes in words, for the report of a difference."""

from __future__ import annotations

import struct

from drivers.canopen import NMT_COMMANDS, NMT_STATES, error_text
from drivers.drive import decode
from drivers.motion import command_text
from drivers.settings import HOST_NODE
from stagectl.config.machine import Machine

_RPDO, _TPDO = struct.Struct("<Hih"), struct.Struct("<Hih")
_SDO_SIZES = {0x2F: 1, 0x2B: 2, 0x27: 3, 0x23: 4, 0x4F: 1, 0x4B: 2, 0x47: 3, 0x43: 4}


def frame_meaning(can_id: int, data: bytes, machine: Machine) -> str:
    """A frame in words, by the predefined connection set and the driver's PDO mapping.

    Args:
        can_id: arbitration id.
        data: up to 8 bytes.
        machine: with the axes.
    """
    function, node = can_id & 0x780, can_id & 0x7F
    axis = next((name for name, a in machine.axes.items() if a.node == node), None)
    host = "the host" if node == HOST_NODE else f"node {node}"
    of = f"axis {axis}" if axis is not None else host
    if can_id == 0x000 and len(data) == 2:
        whom = "all nodes" if data[1] == 0 else f"node {data[1]}"
        return f"NMT {NMT_COMMANDS.get(data[0], f'command {data[0]}')}, {whom}"
    if can_id == 0x080:
        return "SYNC" + (f" {data[0]}" if data else "")
    if function == 0x080 and len(data) == 8:
        return f"emergency of {of}: {error_text(int.from_bytes(data[:2], 'little'))}"
    if function == 0x200 and len(data) == _RPDO.size and axis is not None:
        word, target, offset = _RPDO.unpack(data)
        drive = machine.axes[axis].drive
        return (
            f"RPDO 1 of {of}: {command_text(word)} (0x{word:04X}), "
            f"target {target * drive.position_unit:.10f} m, "
            f"force offset {offset * drive.force_unit:.4g} N"
        )
    if function == 0x180 and len(data) == _TPDO.size and axis is not None:
        word, position, force = _TPDO.unpack(data)
        drive = machine.axes[axis].drive
        return (
            f"TPDO 1 of {of}: {decode(word)} (0x{word:04X}), "
            f"position {position * drive.position_unit:.10f} m, "
            f"force {force * drive.force_unit:.4g} N"
        )
    if function in (0x580, 0x600) and len(data) == 8:
        return f"SDO {'request to' if function == 0x600 else 'answer of'} {of}: {_sdo(data)}"
    if function == 0x700 and len(data) == 1:
        return f"heartbeat of {of}: {NMT_STATES.get(data[0], f'state {data[0]}')}"
    return f"id 0x{can_id:X}, {len(data)} bytes"


def _sdo(data: bytes) -> str:
    command, index, sub = struct.unpack_from("<BHB", data)
    place = f"0x{index:04X}:{sub:02X}"
    if command == 0x40:
        return f"read {place}"
    if command == 0x60:
        return f"{place} written"
    if command == 0x80:
        return f"{place} aborted, 0x{int.from_bytes(data[4:], 'little'):08X}"
    if command in _SDO_SIZES:
        value = int.from_bytes(data[4 : 4 + _SDO_SIZES[command]], "little")
        return f"{'write ' if command < 0x40 else ''}{place} = {value} (0x{value:X})"
    return f"segment or block, command 0x{command:02X}"
