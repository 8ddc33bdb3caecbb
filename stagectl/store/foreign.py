"""Imports columns of a .mat or .csv file as a recording, as an import map assigns them.

MATLAB files of version 4 to 7 (by scipy) and 7.3 (HDF5); CSV with or without a header. Moves are
found from the demand. Nothing is resampled: the samples must be one SYNC period apart.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from sim2real.phases import split_moves
from stagectl.config.import_map import UNITS, Column, ImportMap
from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
from stagedata import AxisSignals, Move, Recording

FloatArray = npt.NDArray[np.float64]
_OFF_PERIOD = 0.1
_MOST_DELAY = 1000


def import_recording(path: Path, how: ImportMap, machine: Machine) -> Recording:
    """Import a file of another program.

    Args:
        path: of the data, .mat or .csv.
        how: the import map.
        machine: that the map names.

    Raises:
        UnusableInput: the file or a column cannot be used; names file, column, row and cause.
    """
    columns = _columns(path)
    period = machine.bus.sync_period
    first = next(iter(how.axes.values())).position_demand
    count = len(_values(columns, first, path, None))
    time = (
        np.arange(count) * period if how.time is None else _values(columns, how.time, path, count)
    )
    time = time - time[0]
    _check_time(time, period, path)
    axes = {}
    for name, axis in how.axes.items():
        axes[name] = AxisSignals(
            _values(columns, axis.position_demand, path, count),
            np.zeros(count)
            if axis.force_offset is None
            else _values(columns, axis.force_offset, path, count),
            _values(columns, axis.position_actual, path, count),
            _values(columns, axis.force_actual, path, count),
            None,
            time >= how.skip,
        )
    found = Recording(machine.text, "", "", time, axes, (), str(path))
    return Recording(machine.text, "", "", time, axes, _moves(found, period), str(path))


def _columns(path: Path) -> dict[str, FloatArray]:
    """All one-dimensional numeric columns by name."""
    if not path.is_file():
        raise UnusableInput(f"{path}: {'is not a file' if path.exists() else 'no such file'}")
    suffix = path.suffix.lower()
    if suffix == ".mat":
        columns = _hdf5_columns(path) if h5py.is_hdf5(path) else _matlab_columns(path)
    elif suffix in (".csv", ".txt", ".tsv"):
        columns = _csv_columns(path)
    else:
        raise UnusableInput(f"{path}: {suffix or 'no suffix'}: only .mat and .csv are read")
    if not columns:
        raise UnusableInput(f"{path}: no numeric column")
    return columns


def _matlab_columns(path: Path) -> dict[str, FloatArray]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path)
    except (MatReadError, ValueError, TypeError, OSError, NotImplementedError, KeyError) as error:
        line = str(error).split("\n")[0]
        raise UnusableInput(f"{path}: not a readable .mat file: {line}") from error
    return {
        name: np.asarray(values, dtype=np.float64).ravel()
        for name, values in content.items()
        if not name.startswith("__")
        and isinstance(values, np.ndarray)
        and values.dtype.kind in "fiub"
        and max(values.shape, default=0) == values.size > 1
    }


def _hdf5_columns(path: Path) -> dict[str, FloatArray]:
    try:
        with h5py.File(path, "r") as file:
            return {
                name: np.asarray(member[()], dtype=np.float64).ravel()
                for name, member in file.items()
                if isinstance(member, h5py.Dataset)
                and member.dtype.kind in "fiub"
                and max(member.shape, default=0) == member.size > 1
            }
    except (OSError, RuntimeError, KeyError) as error:
        raise UnusableInput(f"{path}: not a readable .mat file (version 7.3)") from error


def _csv_columns(path: Path) -> dict[str, FloatArray]:
    """Columns by header, or by number from 1 where the first line holds numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeError) as error:
        raise UnusableInput(f"{path}: not readable text") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise UnusableInput(f"{path}: empty")
    delimiter = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(lines, delimiter=delimiter))
    header = [cell.strip() for cell in rows[0]]
    body = rows if all(_is_number(cell) for cell in header) else rows[1:]
    names = [str(i + 1) for i in range(len(header))] if body is rows else header
    values = np.empty((len(body), len(names)))
    for r, row in enumerate(body):
        place = f"{path}: row {r + 1 + len(rows) - len(body)}"
        if len(row) != len(names):
            raise UnusableInput(f"{place}: {len(row)} values, the first row has {len(names)}")
        for c, cell in enumerate(row):
            if not _is_number(cell):
                raise UnusableInput(f"{place}, column {names[c]}: {cell.strip()!r} is not a number")
            values[r, c] = float(cell)
    return {name: values[:, c] for c, name in enumerate(names)}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _values(
    columns: Mapping[str, FloatArray], column: Column, path: Path, count: int | None
) -> FloatArray:
    """A column in SI units, of `count` samples."""
    name = str(column.column)
    if name not in columns:
        if column.optional and count is not None:
            return np.zeros(count)
        raise UnusableInput(f"{path}: no column {name!r}; it has {', '.join(sorted(columns))}")
    raw = columns[name]
    if count is not None and len(raw) != count:
        raise UnusableInput(f"{path}: column {name}: {len(raw)} samples, the demand has {count}")
    if not np.all(np.isfinite(raw)):
        sample = int(np.argmin(np.isfinite(raw)))
        raise UnusableInput(f"{path}: column {name}: sample {sample}: is {raw[sample]}")
    if not 0 <= column.delay <= _MOST_DELAY:
        raise UnusableInput(f"{path}: column {name}: delay must be 0 to {_MOST_DELAY} samples")
    factor = column.factor * (UNITS[column.unit] if column.unit is not None else 1.0)
    values = raw * factor + column.offset
    if column.delay:
        values = np.concatenate((np.repeat(values[:1], column.delay), values[: -column.delay]))
    return values


def _check_time(time: FloatArray, period: float, path: Path) -> None:
    if len(time) < 2:
        raise UnusableInput(f"{path}: {len(time)} samples")
    steps = np.diff(time)
    if np.any(steps <= 0):
        sample = int(np.argmax(steps <= 0)) + 1
        raise UnusableInput(f"{path}: time: sample {sample}: not later than the one before")
    usual = float(np.median(steps))
    if abs(usual - period) > _OFF_PERIOD * period:
        raise UnusableInput(
            f"{path}: samples are {usual:.6g} s apart, the machine file's sync_period is "
            f"{period:g} s"
        )


def _moves(recording: Recording, period: float) -> tuple[Move, ...]:
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
