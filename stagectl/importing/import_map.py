"""The map that turns data of other programs into a recording: columns, units, delays, machine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from stagectl.config.machine import Axis, AxisName, Machine, Name
from stagectl.config.parsing.units import NotNegativeTime, Number
from stagectl.config.parsing.validation import Section, validate
from stagectl.config.parsing.yaml_nodes import load_document
from stagectl.errors import ConfigError
from stagectl.importing.log_machine import load_log_machine, stated_period

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
ROTARY_UNITS = {
    "rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "rev": 2.0 * math.pi,
    "N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3,
}  # fmt: skip
"""A rotary axis has rad for m, N m for N and kg m^2 for kg."""
UNITS = ROTARY_UNITS | TIMES | {
    "m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9, "N": 1.0, "mN": 1e-3, "kN": 1e3,
}  # fmt: skip
"""Units of columns, in SI units."""
ROTARY_SPEEDS = {
    "rad/s": 1.0, "deg/s": math.pi / 180.0, "rev/s": 2.0 * math.pi, "rpm": math.pi / 30.0,
}  # fmt: skip
SPEEDS = ROTARY_SPEEDS | {
    "m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0, "mm/min": 1e-3 / 60.0,
}  # fmt: skip
"""Units of a velocity that is integrated to a position."""
BY_FACTOR = ("A", "V")
"""Units that need a factor [N or N m per unit]."""
OF_THE_AXIS = {
    "counts": ("encoder", "increment"),
    **dict.fromkeys(("%", "permille"), ("drive", "rated_force")),
}
"""Units -> section and key of the machine file that state them."""


def unit_factor(unit: str | None, axis: Axis | None) -> float:
    """SI units per unit of a column.

    Args:
        unit: a key of `UNITS` or `SPEEDS`, or one of `BY_FACTOR` or `OF_THE_AXIS`; None: SI.
        axis: that the column belongs to, None for the time.
    """
    if unit == "counts" and axis is not None:
        return axis.encoder.increment
    if unit in ("%", "permille") and axis is not None:
        return axis.drive.rated_force / (100.0 if unit == "%" else 1000.0)
    return 1.0 if unit is None or unit in BY_FACTOR else (UNITS | SPEEDS)[unit]


class Column(Section):
    """One column of the data.

    Attributes:
        column: its name; its number from 1 in CSV files without a header.
        unit: of its values.
        factor: multiplied with the values, in addition to `unit`.
        offset: added after that [SI].
        delay: samples by which to shift it later; below 0: earlier.
        optional: use zeros if the data do not have the column.
        file: a key of `files` where it is not in DATA itself.
        wrap: the values begin anew after this much, in their unit: 360 for an angle in degrees.
        integrate: a velocity, whose integral is the position from 0 on.
        format: of dates and times of day that are not ISO 8601, as Python's strptime has it.
    """

    column: Name | int
    unit: str | None = None
    factor: Number = 1.0
    offset: Number = 0.0
    delay: int = 0
    optional: bool = False
    file: Name | None = None
    wrap: Annotated[Number, Field(gt=0.0)] | None = None
    integrate: bool = False
    format: Name | None = None


class OtherFile(Section):
    """A further file of the data.

    Attributes:
        path: relative to the folder of DATA.
        time: its column of the time, on the clock of DATA's; None: it has DATA's samples.
        preamble: lines before its header; None: found by itself.
    """

    path: Name
    time: Column | None = None
    preamble: Annotated[int, Field(ge=0)] | None = None


class AxisColumns(Section):
    """Columns of one axis, named as in the recording format.

    Without `position_demand` the measured position, smoothed, takes its place: data without a
    demand, whose controller cannot be known. Without `force_actual` nothing says what the motion
    took, and there is no diagnosis.
    """

    position_demand: Column | None = None
    position_actual: Column
    force_actual: Column | None = None
    force_offset: Column | None = None

    def given(self) -> dict[str, Column]:
        """The columns that there are, by channel."""
        return {channel: column for channel, column in self if column is not None}


class ImportMap(Section):
    """How data become a recording.

    Attributes:
        machine: machine file, relative to the map.
        time: column of the time; None: samples are one SYNC period apart.
        skip: samples before this time are marked invalid [s].
        preamble: lines of DATA before its header; None: found by itself.
        files: further files by a name of their own.
        resample: read all channels at whole SYNC periods; samples may be uneven or more frequent.
        axes: columns of each axis of the machine file.
    """

    machine: Name
    time: Column | None = None
    skip: NotNegativeTime = 0.0
    preamble: Annotated[int, Field(ge=0)] | None = None
    files: Mapping[Name, OtherFile] = Field(default_factory=dict)
    resample: bool = False
    axes: Annotated[Mapping[AxisName, AxisColumns], Field(min_length=1)]

    def column_names(self) -> set[str]:
        """The names of all columns that are mapped, of whichever file."""
        columns = [self.time, *(file.time for file in self.files.values())]
        for axis in self.axes.values():
            columns += axis.given().values()
        return {str(column.column) for column in columns if column is not None}


def unlike_rotary(found: ImportMap, machine: Machine) -> list[str]:
    """Axes with units of a rotary axis that the machine file does not call one."""
    return [
        name
        for name, axis in found.axes.items()
        if not machine.axes[name].rotary
        and any(column.unit in ROTARY_UNITS | ROTARY_SPEEDS for column in axis.given().values())
    ]


def load_map(path: Path) -> tuple[ImportMap, Machine]:
    """The map of a file, and the machine file that it names.

    Raises:
        ConfigError: either cannot be used; one line per problem.
    """
    document = load_document(path)
    found = validate(document, ImportMap)
    machine = load_log_machine(path.parent / found.machine)
    given: Any = machine.document.data
    problems: list[str] = []

    def refuse(place: tuple[str, ...], reason: str, at_key: bool = False) -> None:
        problems.append(document.problem(place, reason, at_key=at_key))

    for name in found.axes:
        if name not in machine.axes:
            refuse(("axes", name), f"the machine file has no axis {name}", True)
    for name in machine.axes:
        if name not in found.axes:
            refuse(("axes",), f"axis {name} of the machine file is missing", True)
    if found.time is None and stated_period(given) is None:
        refuse(("machine",), "the machine file has no bus.sync_period, and the map no time")
    times: dict[tuple[str, ...], Column | None] = {("time",): found.time}
    times |= {("files", name, "time"): file.time for name, file in found.files.items()}
    for place, time in times.items():
        if time is not None and time.unit not in (None, *TIMES):
            refuse((*place, "unit"), f"unknown unit {time.unit!r}; known: {', '.join(TIMES)}")
    for name, axis in found.axes.items():
        for channel, column in axis.given().items():
            place = ("axes", name, channel)
            if column.integrate and not channel.startswith("position"):
                reason = "only a velocity that stands for a position is integrated"
                refuse((*place, "integrate"), reason)
                continue
            known = {*(SPEEDS if column.integrate else UNITS), *BY_FACTOR, *OF_THE_AXIS}
            if column.unit is not None and column.unit not in known:
                listed = ", ".join(sorted(known))
                refuse((*place, "unit"), f"unknown unit {column.unit!r}; known: {listed}")
            if column.unit in BY_FACTOR and "factor" not in column.model_fields_set:
                refuse((*place, "unit"), f"needs a factor: newtons (or N m) per {column.unit}")
            section, key = OF_THE_AXIS.get(column.unit or "", ("", ""))
            if section and key not in (((given["axes"].get(name) or {}).get(section)) or {}):
                refuse((*place, "unit"), f"the machine file has no {section}.{key}")
            if column.file is not None and column.file not in found.files:
                refuse((*place, "file"), f"no such file in `files`: {column.file}")
    if problems:
        raise ConfigError(problems)
    return found, machine
