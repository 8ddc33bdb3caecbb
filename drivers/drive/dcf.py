"""Parameter values of a DCF: written at every boot and read back; differences are one error.

A DCF is an EDS with a `ParameterValue` where the drive is to hold a value other than its default.
Objects that the driver sets itself (communication, PDOs, controlword, mode, setpoints) are skipped.
Drives may round velocities and accelerations; all other values have to be exact.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import canopen
from canopen.objectdictionary import ODVariable

from drivers.canopen import Node, Value
from drivers.drive.parameters import Parameter, Rule
from drivers.errors import ConfigurationError, RefusedError, shown
from drivers.objects import ObjectRef

LISTED = 5
"""Differences listed in the error; of further ones only the number."""
_OURS = {
    0x1005, 0x1006, 0x1007, 0x1014, 0x1016, 0x1017, 0x1019, 0x1010, 0x1011,
    0x6040, 0x6060, 0x607A, 0x60FF, 0x6071, 0x60B2, 0x60C2,
}  # fmt: skip
_PDOS = range(0x1400, 0x1C00)
_ROUNDED = {0x607F, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6099, 0x609A, 0x60C5, 0x60C6}
"""Velocities and accelerations."""


def parameter_values(dictionary: canopen.ObjectDictionary) -> list[tuple[ObjectRef, Value]]:
    """Objects with a `ParameterValue`, and that value, in the order of their indices."""
    return [
        (ObjectRef(variable.index, variable.subindex, variable.name), variable.value)
        for index in sorted(dictionary)
        if index not in _OURS and index not in _PDOS
        for variable in _variables(dictionary[index])
        if variable.value is not None and variable.writable
    ]


def _variables(entry: Any) -> Iterable[ODVariable]:
    return [entry] if isinstance(entry, ODVariable) else entry.values()


def apply(node: Node, values: list[tuple[ObjectRef, Value]]) -> list[str]:
    """Writes the values that the drive does not hold already, and reads all of them back.

    Returns:
        What the drive has rounded, one clause each.

    Raises:
        ConfigurationError: names the objects that were refused or hold another value.
        NodeError: the node does not answer.
    """
    differences, rounded, refused = [], [], set()
    for ref, value in values:
        try:
            if not _holds(node, ref, value):
                node.write(ref, value)
        except (RefusedError, ConfigurationError) as error:
            differences.append(f"{ref} {error.cause}")
            refused.add(ref)
    for ref, value in values:
        if ref in refused:
            continue
        held = _held(node, ref, value)
        if held == _as_held(node, ref, value):
            continue
        if _is_rounded(ref, value, held):
            rounded.append(
                f"{ref} is {shown(held)}, not {shown(value)} as in the DCF: the drive rounds it"
            )
        else:
            differences.append(f"{ref} wrote {shown(value)}, the drive holds {shown(held)}")
    if differences:
        more = len(differences) - LISTED
        text = "; ".join(differences[:LISTED]) + (f"; and {more} more" if more > 0 else "")
        raise ConfigurationError(
            f"DCF: {len(differences)} of {len(values)} objects differ: {text}", axis=node.name
        )
    return rounded


def _held(node: Node, ref: ObjectRef, value: Value) -> Value:
    return node.read(ref) if isinstance(value, int) else node.read_value(ref)


def _holds(node: Node, ref: ObjectRef, value: Value) -> bool:
    """Whether the drive holds the value already, as in an object fixed at it."""
    try:
        return _held(node, ref, value) == _as_held(node, ref, value)
    except RefusedError:
        return False  # the write will tell why


def _is_rounded(ref: ObjectRef, value: Value, held: Value) -> bool:
    if ref.index not in _ROUNDED or not (isinstance(value, int) and isinstance(held, int)):
        return False
    return Parameter(ref, value, Rule.ROUNDED).is_rounded(held)


def _as_held(node: Node, ref: ObjectRef, value: Value) -> Value:
    """The value in the precision of the object."""
    variable = node.dictionary.get_variable(ref.index, ref.sub)
    if variable is None or not isinstance(value, float):
        return value
    return float(variable.decode_raw(variable.encode_raw(value)))
