"""`stagectl sdo`: objects of a drive, read and written by hand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.bus_access import Bench
from stagectl.cli.lazy import LazyGroup
from stagectl.cli.options import JSON_OUT, takes
from stagectl.cli.terminal import show_result
from stagectl.errors import StagectlError, UnusableInput, unusable

if TYPE_CHECKING:
    from canopen import ObjectDictionary
    from canopen.objectdictionary import ODVariable

    from drivers.canopen import Network, Node, Value
    from drivers.settings import AxisSettings

_DIGITS = re.compile(r"(?:0x)?([0-9a-f]{4})(?:[:.](?:0x)?([0-9a-f]{1,2}))?", re.IGNORECASE)
_WITH_UNIT = re.compile(r"[-+]?(?!0x)[0-9.]+(e[-+]?[0-9]+)?\s*[a-z\u00b5\u03bc].*", re.IGNORECASE)
_COMMANDS = {0x1010, 0x1011}
"""What these hold is not what is written to them ("save", "load")."""
_CONTROLWORD = 0x6040
_DIMENSIONS = {
    "m": "LENGTH", "m/s": "VELOCITY", "m/s^2": "ACCELERATION", "N": "FORCE", "s": "TIME"
}  # fmt: skip
"""Of SI units, in `config.parsing.units`; angles have none there."""


class ObjectType(click.ParamType[tuple[int, int | None]]):
    """An index and, where there is one, a sub-index."""

    name = "OBJECT"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int | None]:
        """Both as numbers."""
        if isinstance(value, tuple):
            return value
        match = _DIGITS.fullmatch(str(value))
        if match is None:
            self.fail(f"'{value}' is no object, such as 0x6064 or 0x6099:01", param, ctx)
        return int(match[1], 16), None if match[2] is None else int(match[2], 16)


COMMANDS = {
    "get": ("stagectl.cli.sdo:get", "Read an object, or all sub-indices of one."),
    "set": ("stagectl.cli.sdo:set_", "Write an object and read it back."),
}


@click.group(name="sdo", cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Read and write objects of a drive, typed and named by its EDS.

    \b
      stagectl sdo get x 0x6064             # position, in the drive's unit and in mm
      stagectl sdo get x 0x607D             # all sub-indices
      stagectl sdo set x 0x6065 0.5mm       # following error window
      stagectl sdo set 1 0x6099:01 20000000

    NODE is an axis of the machine file or its node id. OBJECT is index:sub-index in hexadecimal;
    without a sub-index it is 0, or in `get` all of them. Try it with --simulate.
    """  # noqa: D301  (\b keeps click from wrapping what follows)


@click.command
@click.argument("node")
@click.argument("obj", metavar="OBJECT", type=ObjectType())
@takes(Bench)
@JSON_OUT
def get(bench: Bench, node: str, obj: tuple[int, int | None], json_out: Path | None) -> None:
    """Read OBJECT of NODE: value, SI value or meaning, data type and access.

    \b
      stagectl sdo get x 0x6041 --simulate
      stagectl sdo get y 0x1018 --simulate --json -

    SI values are left out where the drive says that it counts in other units than the machine file.
    Can be used while another host runs the stage, unless that host uses SDO at the same moment.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from canopen.objectdictionary import ODVariable

    from drivers.canopen import load_dictionary
    from drivers.errors import ConfigurationError

    axis = _axis(bench.axes, node)
    with unusable(ConfigurationError):
        dictionary = load_dictionary(axis)
    entry = dictionary.get(obj[0])
    if obj[1] is None and entry is not None and not isinstance(entry, ODVariable):
        variables = [v for v in entry.values() if v.readable]
    else:
        variables = [_variable(dictionary, axis, obj)]
    with bench.observer() as network, _node(network, axis) as remote:
        values = [_read(remote, v) for v in variables]
        problem = _unit_problem(remote, axis, variables)
    agree = problem is None
    entries = [_entry(axis, v, value, agree) for v, value in zip(variables, values, strict=True)]
    if problem is not None:
        click.echo(f"{problem}; values are in the drive's unit", err=True)
    show_result(entries, json_out, *map(_line, entries))


@click.command("set", context_settings={"ignore_unknown_options": True})  # -5 is a value
@click.argument("node")
@click.argument("obj", metavar="OBJECT", type=ObjectType())
@click.argument("value")
@takes(Bench)
@click.option("--yes", is_flag=True,
              help="Write although the axis is enabled, another host is on the bus, or OBJECT is "
                   "the controlword.")  # fmt: skip
@JSON_OUT
def set_(
    bench: Bench,
    node: str,
    obj: tuple[int, int | None],
    value: str,
    yes: bool,
    json_out: Path | None,
) -> None:
    """Write VALUE to OBJECT of NODE, and read it back.

    \b
      stagectl sdo set x 0x6065 0.5mm --simulate
      stagectl sdo set x 0x607C -1000 --simulate

    VALUE is a number in the drive's unit (0x for hexadecimal) or one with its own unit, such as
    0.5mm; a text or hexadecimal bytes where the EDS says so. It is checked against data type and
    limits of the EDS before the bus is opened.

    Refused while the axis is under force, while another host is on the bus, and for the
    controlword (0x6040), unless --yes is given. Nothing watches the drive after this command.
    Exit code 1 if the drive holds another value afterwards.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from drivers.canopen import LISTENING, load_dictionary
    from drivers.commissioning import raw_text
    from drivers.errors import ConfigurationError

    axis = _axis(bench.axes, node)
    with unusable(ConfigurationError):
        variable = _variable(load_dictionary(axis), axis, obj)
        wanted, converted = _parse(value, variable, axis)
    ref = _reference(variable)
    if not variable.writable:
        raise UnusableInput(f"axis {axis.name}: {ref}: the EDS says read-only")
    if variable.index == _CONTROLWORD and not yes:
        raise UnusableInput(f"axis {axis.name}: {ref}: commands the drive; --yes writes it")
    with bench.observer() as network, _node(network, axis) as remote:
        if not yes:
            network.listen(LISTENING)  # refuses a bus on which a host is active
            _require_no_force(remote)
        problem = _unit_problem(remote, axis, [variable])
        if problem is not None:
            if converted:
                raise UnusableInput(f"{problem}; give VALUE in the drive's unit")
            click.echo(f"{problem}; values are in the drive's unit", err=True)
        readable = variable.readable and variable.index not in _COMMANDS
        before = _read(remote, variable) if readable else None
        remote.write(ref, wanted)
        held = _read(remote, variable) if readable else wanted
    entry = _entry(axis, variable, held, problem is None)
    was = "" if before is None else f" (was {raw_text(ref, before, len(variable))})"
    show_result({**entry, "before": _plain(before)}, json_out, _line(entry) + was)
    if held != wanted:
        raise StagectlError(
            f"axis {axis.name}: {ref}: wrote {raw_text(ref, wanted, len(variable))}, the drive "
            f"holds {raw_text(ref, held, len(variable))}"
        )


def _axis(axes: tuple[AxisSettings, ...], node: str) -> AxisSettings:
    for axis in axes:
        if node in (axis.name, str(axis.node)):
            return axis
    known = ", ".join(f"{a.name} (node {a.node})" for a in axes)
    raise click.BadParameter(f"no axis or node '{node}'; there are {known}", param_hint="NODE")


def _variable(
    dictionary: ObjectDictionary, axis: AxisSettings, obj: tuple[int, int | None]
) -> ODVariable:
    from canopen.objectdictionary import ODVariable

    index, sub = obj
    entry = dictionary.get(index)
    if entry is None:
        raise click.BadParameter(f"0x{index:04X} is not in {axis.eds.name}", param_hint="OBJECT")
    if isinstance(entry, ODVariable):
        if not sub:
            return entry
        subs = [0]
    elif sub is not None and sub in entry.subindices:
        found: ODVariable = entry[sub]
        return found
    else:
        subs = sorted(entry)
    offered = ", ".join(f"{one:02X}" for one in subs)
    asked = f"0x{index:04X}" if sub is None else f"0x{index:04X}:{sub:02X}"
    raise click.BadParameter(
        f"{asked}: {axis.eds.name} has the sub-indices {offered} of it", param_hint="OBJECT"
    )


def _parse(text: str, variable: ODVariable, axis: AxisSettings) -> tuple[Value, bool]:
    """A value in the drive's unit, and whether it has been converted from a unit of its own."""
    from drivers.commissioning import parse, unit_of
    from stagectl.config.parsing import units

    unit = unit_of(_reference(variable), axis)
    if unit is None or unit[1] not in _DIMENSIONS or not _WITH_UNIT.fullmatch(text):
        return parse(text, variable, axis), False
    size, name = unit
    with unusable(ValueError, about=f"axis {axis.name}: {_reference(variable)}: "):
        value = units.parse_quantity(text, getattr(units, _DIMENSIONS[name]))
    return parse(str(round(value / size)), variable, axis), True


def _reference(variable: ODVariable) -> Any:
    from drivers.commissioning import reference

    return reference(variable)


@contextmanager
def _node(network: Network, axis: AxisSettings) -> Iterator[Node]:
    from drivers.canopen import Node

    node = Node(network, axis)
    try:
        yield node
    finally:
        node.detach()


def _read(node: Node, variable: ODVariable) -> Value:
    from canopen.objectdictionary import INTEGER_TYPES

    ref = _reference(variable)
    # some drives send four bytes for every number, which `read` takes
    return node.read(ref) if variable.data_type in INTEGER_TYPES else node.read_value(ref)


def _unit_problem(node: Node, axis: AxisSettings, variables: list[ODVariable]) -> str | None:
    """Why the drive's unit of one of these is not the machine file's; None where it is."""
    from drivers.commissioning import unit_of
    from drivers.drive import check_units
    from drivers.errors import ConfigurationError

    if all(unit_of(_reference(v), axis) is None for v in variables):
        return None
    try:
        check_units(node, axis)
    except ConfigurationError as problem:
        return str(problem)
    return None


def _require_no_force(node: Node) -> None:
    from drivers import objects as od
    from drivers.drive import State, decode

    state = decode(node.read(od.STATUSWORD))
    if state in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE):
        raise UnusableInput(
            f"axis {node.name}: is in {state}, under force: what is written may move it at once; "
            "--yes writes it"
        )


def _entry(
    axis: AxisSettings, variable: ODVariable, value: Value, units_agree: bool
) -> dict[str, Any]:
    from drivers.commissioning import meaning, raw_text, type_name, unit_of

    ref = _reference(variable)
    known = units_agree and isinstance(value, int | float)
    unit = unit_of(ref, axis) if known else None
    return {
        "axis": axis.name,
        "node": axis.node,
        "object": f"0x{ref.index:04X}:{ref.sub:02X}",
        "name": ref.name,
        "type": type_name(variable),
        "access": variable.access_type,
        "value": _plain(value),
        "si": None if unit is None else value * unit[0],  # type: ignore[operator]
        "unit": None if unit is None else unit[1],
        "text": raw_text(ref, value, len(variable)),
        "meaning": meaning(ref, value, axis if units_agree else None),
    }


def _plain(value: Value | None) -> int | float | str | None:
    """As JSON has it: bytes as hexadecimal digits."""
    return value.hex() if isinstance(value, bytes | bytearray) else value


def _line(entry: dict[str, Any]) -> str:
    meant = "" if entry["meaning"] is None else f" = {entry['meaning']}"
    kind = f"{entry['type']}, {entry['access']}"
    return f"{entry['object']} {entry['name']}: {entry['text']}{meant}  [{kind}]"
