"""The map that turns data of other programs into a recording: columns, units, delays, machine."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import Field, StrictBool, StrictInt

from stagectl.config.machine import AxisName, Machine, Name
from stagectl.config.machine_file import load_machine
from stagectl.config.units import NotNegativeTime, Number
from stagectl.config.validation import Section, validate
from stagectl.config.yaml_nodes import load_document
from stagectl.errors import ConfigError

UNITS = {
    "m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9,
    "N": 1.0, "mN": 1e-3, "kN": 1e3,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6,
}  # fmt: skip
"""Units of columns, in SI units."""


class Column(Section):
    """One column of the data.

    Attributes:
        column: its name; its number from 1 in CSV files without a header.
        unit: of its values.
        factor: multiplied with the values, in addition to `unit`.
        offset: added after that [SI].
        delay: samples by which to shift it later.
        optional: use zeros if the data do not have the column.
    """

    column: Name | StrictInt
    unit: str | None = None
    factor: Number = 1.0
    offset: Number = 0.0
    delay: StrictInt = 0
    optional: StrictBool = False


class AxisColumns(Section):
    """Columns of one axis, named as in the recording format."""

    position_demand: Column
    position_actual: Column
    force_actual: Column
    force_offset: Column | None = None


class ImportMap(Section):
    """How data become a recording.

    Attributes:
        machine: machine file, relative to the map.
        time: column of the time; None: samples are one SYNC period apart.
        skip: samples before this time are marked invalid [s].
        axes: columns of each axis of the machine file.
    """

    machine: Name
    time: Column | None = None
    skip: NotNegativeTime = 0.0
    axes: Annotated[Mapping[AxisName, AxisColumns], Field(min_length=1)]


def load_map(path: Path) -> tuple[ImportMap, Machine]:
    """The map of a file, and the machine file that it names.

    Raises:
        ConfigError: either cannot be used; one line per problem.
    """
    document = load_document(path)
    found = validate(document, ImportMap)
    machine = load_machine(path.parent / found.machine)
    problems = [
        document.problem(("axes", name), f"the machine file has no axis {name}", at_key=True)
        for name in found.axes
        if name not in machine.axes
    ]
    problems += [
        document.problem(("axes",), f"axis {name} of the machine file is missing", at_key=True)
        for name in machine.axes
        if name not in found.axes
    ]
    for name, axis in found.axes.items():
        for channel in ("position_demand", "position_actual", "force_actual", "force_offset"):
            column = getattr(axis, channel)
            if column is not None and column.unit is not None and column.unit not in UNITS:
                problems.append(
                    document.problem(
                        ("axes", name, channel, "unit"),
                        f"unknown unit {column.unit!r}; known: {', '.join(UNITS)}",
                    )
                )
    if problems:
        raise ConfigError(problems)
    return found, machine
