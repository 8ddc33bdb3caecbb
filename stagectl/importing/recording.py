"""Imports the data of another program as a recording, as an import map assigns its columns.

Units become SI at this border. Channels may come from several files, each with a time of its own.
With `resample` all channels are read at whole SYNC periods; without, the samples must be one period
apart. Moves are found from the demand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stagectl.config import parse_machine, stage_settings
from stagectl.config.machine import Axis, Machine
from stagectl.errors import UnusableInput
from stagectl.importing.columns import Columns
from stagectl.importing.import_map import TIMES, AxisColumns, Column, ImportMap, unit_factor
from stagectl.importing.log_machine import (
    SPARSE,
    completed,
    is_complete,
    own_period,
    stated_period,
)
from stagectl.store.hdf5 import MAX_SAMPLES
from stagedata import AxisSignals, Move, Recording

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
_OFF_PERIOD = 0.1
_LEAST_KEPT = 0.005
"""Smallest share of the rows that resampling may keep."""
_HOLE = 2.5
"""Usual distances of the samples beyond which there is a hole, in which nothing is valid."""
_MOST_DELAY = 1000
_READ_BETWEEN = "; `resample: true` reads between the others"
_SMOOTHED = 11
"""Samples over which a measured position becomes the demand where none was logged."""


def import_recording(path: Path, how: ImportMap, machine: Machine) -> Recording:
    """Import files of another program.

    Args:
        path: of the data: .mat, or text.
        how: the import map.
        machine: that the map names.

    Raises:
        UnusableInput: a file or a column cannot be used; names file, column, row and cause.
    """
    given: Any = machine.document.data
    period = machine.bus.sync_period
    files = {"": _read(path, how.preamble, how.time, period, how)}
    is_stated = stated_period(given) is not None
    if not is_stated:
        period = own_period(files[""].time, str(path))
    for name, other in how.files.items():
        files[name] = _read(path.parent / other.path, other.preamble, other.time, period, how)
    first = files[""]
    time = first.time - first.time[0]
    if how.resample:
        _check_rate(time, period, path, how.time)
        _check_holes(time, period, path)
        time = np.arange(int((time[-1] - time[0]) / period + 1e-6) + 1) * period
    else:
        whose = "the machine file's sync_period is" if is_stated else "their mean is"
        _check_time(time, period, whose, path, how.time)
    axes = {}
    for name, axis in how.axes.items():
        channels = _Channels(files, time, how.resample, machine.axes[name])
        axes[name] = channels.signals(axis, time >= how.skip)
    if len(time) < 2:
        raise UnusableInput(f"{path}: {len(time)} samples")
    found = Recording(machine.text, "", "", time, axes, (), str(path))
    if not is_complete(given):
        machine = completed(given, [found], period)
        found = replace(found, machine=machine.text)
    return replace(found, moves=_moves(found, machine, period))


def doubtful_positions(recording: Recording) -> list[str]:
    """Positions in another unit, sign or scale than their demand, one sentence each."""
    from sim2real.audit import check_position

    settings = stage_settings(parse_machine(recording.machine, recording.source, fitted=True))
    return [
        finding.text
        for axis in settings.axes
        if "position_demand" not in recording.axes[axis.name].missing
        for finding in check_position(recording.axes[axis.name], axis, settings.sync_period)
        if finding.finding != "offset"
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _File:
    """The columns of a file and its own time [s]."""

    columns: Columns
    time: FloatArray
    has_time: bool


def _read(
    path: Path, preamble: int | None, time: Column | None, period: float, how: ImportMap
) -> _File:
    columns = Columns(path, preamble, how.column_names())
    if time is None:
        channels = next(iter(how.axes.values()))
        used = str((channels.position_demand or channels.position_actual).column)
        count = len(columns[used]) if used in columns else 0
        return _File(columns, np.arange(float(count)) * period, has_time=False)
    values = _in_si(columns, time, None)
    steps = np.diff(values)
    disordered = steps < 0 if how.resample else steps <= 0
    if np.any(disordered):
        sample = int(np.argmax(disordered)) + 1
        late = "earlier than the one before"
        if not how.resample and steps[sample - 1] == 0.0:
            late = "not later than the one before; `resample: true` takes the first of the two"
        raise UnusableInput(f"{path}: time: sample {sample}: {late}")
    return _File(columns, values, has_time=True)


@dataclass(frozen=True, slots=True, eq=False)
class _Channels:
    """The channels of one axis at the times of the recording."""

    files: Mapping[str, _File]
    time: FloatArray
    resample: bool
    axis: Axis

    def signals(self, columns: AxisColumns, valid: BoolArray) -> AxisSignals:
        """The signals of the axis; without a logged demand the smoothed position is one."""
        from scipy.signal import savgol_filter  # slow to import; a run does not need it

        demand = None
        if columns.position_demand is not None:
            demand, _ = self._values(columns.position_demand, smooth=True)
        position, holes = self._values(columns.position_actual, smooth=True)
        force, more = np.zeros(len(self.time)), np.zeros(len(self.time), dtype=bool)
        if columns.force_actual is not None:
            force, more = self._values(columns.force_actual)
        named = {"position_demand": demand, "force_actual": columns.force_actual}
        missing = tuple(name for name, column in named.items() if column is None)
        if demand is None:
            enough = len(position) >= _SMOOTHED
            demand = savgol_filter(position, _SMOOTHED, 2) if enough else position
        offset = np.zeros(len(self.time))
        if columns.force_offset is not None:
            offset, _ = self._values(columns.force_offset)
        return AxisSignals(demand, offset, position, force, None, valid & ~holes & ~more, missing)

    def _values(self, column: Column, smooth: bool = False) -> tuple[FloatArray, BoolArray]:
        """A channel and where it has holes."""
        from scipy.interpolate import PchipInterpolator

        file = self.files[column.file or ""]
        first = self.files[""]
        name = str(column.column)
        none = np.zeros(len(self.time), dtype=bool)
        if column.optional and name not in file.columns:
            return np.zeros(len(self.time)), none
        values = _in_si(file.columns, column, self.axis)
        own_time = file is not first and file.has_time
        if not self.resample and not own_time:
            if len(values) != len(self.time):
                raise UnusableInput(
                    f"{file.columns.path}: column {name}: {len(values)} samples, "
                    f"the demand has {len(self.time)}"
                )
            _refuse_gaps(file.columns.path, name, values, _READ_BETWEEN)
            return _integral(values, self.time) if column.integrate else values, none
        at = (file.time if file.has_time else first.time) - first.time[0]
        if len(values) != len(at):
            raise UnusableInput(
                f"{file.columns.path}: column {name}: {len(values)} samples, its time has {len(at)}"
            )
        known = np.isfinite(values)
        known[1:] &= np.diff(at) > 0.0  # of samples of one instant, the first
        if known.sum() < 2:
            raise UnusableInput(f"{file.columns.path}: column {name}: no samples")
        at, values = at[known], values[known]
        if column.integrate:
            values = _integral(values, at)
        wanted = np.clip(self.time, at[0], at[-1])
        # Positions are smooth between samples; forces may step.
        read = PchipInterpolator(at, values)(wanted) if smooth else np.interp(wanted, at, values)
        return read, _in_hole(self.time, at)


def _in_hole(time: FloatArray, at: FloatArray) -> BoolArray:
    """Which times have no sample near them, bool[K]."""
    reach = _HOLE * float(np.median(np.diff(at)))
    after = np.clip(np.searchsorted(at, time), 1, len(at) - 1)
    inside: BoolArray = at[after] - at[after - 1] > reach
    on_sample = (np.abs(at[after] - time) < 1e-9) | (np.abs(at[after - 1] - time) < 1e-9)
    outside = (time < at[0] - 1e-9) | (time > at[-1] + 1e-9)
    hole: BoolArray = (inside & ~on_sample) | outside
    return hole


def _in_si(columns: Columns, column: Column, axis: Axis | None) -> FloatArray:
    """A column in SI units; of a time, also dates and times of day."""
    name = str(column.column)
    factor = column.factor * unit_factor(column.unit, axis)
    if axis is None and (moments := columns.seconds(name, column.format)) is not None:
        return moments
    values = columns[name]
    if column.wrap is not None:
        values = values.copy()
        known = np.isfinite(values)
        values[known] = np.unwrap(values[known], period=column.wrap)
    values = values * factor + column.offset
    if abs(column.delay) > _MOST_DELAY:
        limits = f"-{_MOST_DELAY} to {_MOST_DELAY}"
        raise UnusableInput(f"{columns.path}: column {name}: delay must be {limits} samples")
    values = values[np.clip(np.arange(len(values)) - column.delay, 0, len(values) - 1)]
    if axis is None:
        _refuse_gaps(columns.path, name, values)
    return values


def _integral(velocity: FloatArray, at: FloatArray) -> FloatArray:
    """The position that a velocity [m/s] leads to from 0 on [m]."""
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(at)
    return np.concatenate(([0.0], np.cumsum(steps)))


def _refuse_gaps(path: Path, name: str, values: FloatArray, remedy: str = "") -> None:
    if not np.all(np.isfinite(values)):
        sample = int(np.argmin(np.isfinite(values)))
        raise UnusableInput(f"{path}: column {name}: sample {sample}: is {values[sample]}{remedy}")


def _check_time(
    time: FloatArray, period: float, whose: str, path: Path, column: Column | None
) -> None:
    usual = float(np.median(np.diff(time))) if len(time) > 1 else period
    if abs(usual - period) > _OFF_PERIOD * period:
        raise UnusableInput(
            f"{path}: samples are {usual:.6g} s apart, {whose} {period:g} s; "
            + (_other_unit(usual, period, column) or "`resample: true` reads them at whole periods")
        )


def _check_rate(time: FloatArray, period: float, path: Path, column: Column | None) -> None:
    """Samples may be read at fewer times than they were taken, but not at more."""
    usual = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    kept = int(time[-1] / period + 1e-6) + 1
    if usual > SPARSE * period:
        other = f"choose a sync_period of about {usual:.3g} s in the machine file"
        found = f"there are none to read every {period:g} s"
    elif kept < _LEAST_KEPT * len(time):
        other = "choose a shorter sync_period in the machine file"
        found = f"read every {period:g} s, {kept} of {len(time)} rows are left"
    else:
        return
    raise UnusableInput(
        f"{path}: samples are {usual:.6g} s apart: {found}; "
        + (_other_unit(usual, period, column) or other)
    )


def _other_unit(usual: float, period: float, column: Column | None) -> str:
    """The question whether times are in the unit with which samples are one period apart, or ""."""
    stated = (column.unit if column is not None else None) or "s"
    for unit, seconds in TIMES.items():
        if abs(usual * seconds / TIMES[stated] - period) <= _OFF_PERIOD * period:
            return f"are the times in {unit}? Then state `unit: {unit}`"
    return ""


def _check_holes(time: FloatArray, period: float, path: Path) -> None:
    """Refuse times with longer holes than data, as one wrong date makes them."""
    steps = np.diff(time)
    if not len(steps):
        return
    hole = steps > _HOLE * max(float(np.median(steps)), period)
    if float(steps[hole].sum()) > float(steps[~hole].sum()):
        sample = int(np.argmax(steps))
        raise UnusableInput(
            f"{path}: time: {steps[sample]:.6g} s pass between samples {sample} and {sample + 1}: "
            "the holes are longer than all that was logged"
        )
    if (count := time[-1] / period) > MAX_SAMPLES:
        raise UnusableInput(
            f"{path}: time: {count:.3g} SYNC periods, at most {MAX_SAMPLES} are imported"
        )


def _moves(recording: Recording, machine: Machine, period: float) -> tuple[Move, ...]:
    """The moves of the demand; without one, the strokes of the measured motion."""
    from sim2real.gap import match_periods
    from sim2real.open_loop import measure_motion
    from sim2real.phases import split_moves

    if any("position_demand" in axis.missing for axis in recording.axes.values()):
        settings = stage_settings(machine)
        try:
            strokes = measure_motion(recording, settings).recording.moves
        except ValueError:  # too few samples
            return ()
        place = match_periods(recording.time, settings.sync_period)
        ends = (np.searchsorted(place, (stroke.start, stroke.end)).tolist() for stroke in strokes)
        moved = zip(strokes, ends, strict=True)
        return tuple(replace(m, start=start, end=end) for m, (start, end) in moved if end > start)
    demands = {name: axis.position_demand for name, axis in recording.axes.items()}
    return tuple(
        Move(
            block.kind,
            block.moving,
            block.end,
            {name: float(d[max(block.moving - 1, 0)]) for name, d in demands.items()},
            {name: float(d[block.end - 1]) for name, d in demands.items()},
        )
        for block in split_moves(recording, period)
    )
