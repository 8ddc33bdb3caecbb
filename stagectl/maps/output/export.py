"""Maps and estimates as tables for other programs: CSV, or Parquet (extra `export`: pyarrow)."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from stagectl.errors import UnusableInput, missing_extra
from stagectl.history import History, RunEntry, StageKey
from stagectl.maps.model import MapVersion
from stagectl.store import write_atomically

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_ALL = 10**9
Cell = str | float | int | bool | datetime | None


@dataclass(frozen=True, slots=True)
class Table:
    """Named columns, with units in the names, and rows."""

    columns: tuple[str, ...]
    rows: Sequence[Sequence[Cell]]


def sites_table(version: MapVersion) -> Table:
    """One row per axis and site of a map."""
    return Table(
        ("map", "axis", "x_m", "y_m", "coulomb_N", "sigma_N", "measured", "measurements"),
        [
            (
                version.number, name, *site.place, site.coulomb, site.coulomb * site.sigma,
                _when(site.measured), site.count,
            )
            for name, axis in version.map.axes.items() for site in axis.sites
        ],
    )  # fmt: skip


def grid_table(version: MapVersion, step: float) -> Table:
    """The field of every axis on a grid over its sites, with its 95 % band.

    Args:
        version: of the map.
        step: pitch of the grid [m].
    """
    rows: list[Sequence[Cell]] = []
    for name, axis in version.map.axes.items():
        field = axis.field()
        low, high = field.places.min(axis=0) - field.edge, field.places.max(axis=0) + field.edge
        nodes = [np.arange(a, b + step / 2, step) for a, b in zip(low, high, strict=True)]
        if len(nodes[0]) * len(nodes[1]) > 1_000_000:
            raise UnusableInput(f"a grid of {step:g} m has more than a million nodes")
        places = np.stack(np.meshgrid(*nodes, indexing="ij"), -1).reshape(-1, 2)
        found = field.at(places)
        lower, upper = found.band()
        rows += [
            (version.number, name, float(x), float(y), float(v), float(s), float(a), float(b),
             bool(i))
            for (x, y), v, s, a, b, i in zip(
                places, found.value, found.value * found.sigma, lower, upper, found.inside,
                strict=True,
            )
        ]  # fmt: skip
    return Table(
        ("map", "axis", "x_m", "y_m", "coulomb_N", "sigma_N", "low_N", "high_N", "inside"), rows
    )


def trend_table(history: History, stage: StageKey) -> Table:
    """Every accepted estimate of every place and axis."""
    runs = _runs(history, stage)
    axes = next(iter(runs.values())).axes if runs else ()
    rows: list[dict[str, Cell]] = []
    for place in history.places(stage):
        for axis in axes:
            trend = history.trend(stage, axis, place)
            for k in range(len(trend)):
                row: dict[str, Cell] = {
                    "axis": axis, "x_m": place[0], "y_m": place[1],
                    "time": _when(float(trend.time[k])), "kind": trend.kind[k],
                    **_run(trend.run[k], runs),
                }  # fmt: skip
                for name, values in trend.values.items():
                    row[name] = _number(float(values[k]))
                    row[f"{name}_sigma"] = _number(float(trend.sigma[name][k]))
                row["level"] = float(trend.level[k])
                row["temperature_C"] = _number(float(trend.temperature[k]))
                rows.append(row)
    return _table(rows)


def refused_table(history: History, stage: StageKey) -> Table:
    """Every refused estimate with its reason, newest first."""
    runs = _runs(history, stage)
    return _table(
        [
            {
                "axis": e.axis, "x_m": e.place[0], "y_m": e.place[1], "time": _when(e.time),
                "kind": e.kind, **_run(e.run, runs), "site": e.site, "distance_m": e.distance,
                "reason": e.reason,
            }
            for e in history.refused(stage, last=_ALL)
        ]
    )  # fmt: skip


def _runs(history: History, stage: StageKey) -> dict[int, RunEntry]:
    return {number: run for number, run, _ in history.runs(stage, last=_ALL)}


def _run(number: int, runs: Mapping[int, RunEntry]) -> dict[str, Cell]:
    if number not in runs:
        raise UnusableInput(f"an estimate is of run {number}, which the history does not have")
    run = runs[number]
    names = ("purpose", "recipe", "lot", "wafer", "software")
    return {"run": number, **{name: getattr(run, name) for name in names}}


def _table(rows: Sequence[Mapping[str, Cell]]) -> Table:
    """Columns in the order of their first appearance."""
    columns = tuple(dict.fromkeys(name for row in rows for name in row))
    return Table(columns, [[row.get(name) for name in columns] for row in rows])


def write_table(table: Table, path: Path) -> None:
    """Write a table in the format of the file's suffix.

    Raises:
        UnusableInput: a suffix other than .csv and .parquet, or pyarrow is missing.
        StagectlError: it cannot be written.
    """
    if path.suffix == ".csv":
        text = io.StringIO()
        writer = csv.writer(text)
        writer.writerow(table.columns)
        writer.writerows([_as_text(cell) for cell in row] for row in table.rows)
        data = text.getvalue().encode()
    elif path.suffix == ".parquet":
        data = _parquet(table)
    else:
        raise UnusableInput(f"{path}: write .csv or .parquet")
    write_atomically(path, data, "table")


def _as_text(cell: Cell) -> Cell:
    """A cell for CSV; a text that a spreadsheet would run as a formula gets an apostrophe."""
    if isinstance(cell, datetime):
        return cell.isoformat(timespec="milliseconds")
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell


def _when(time: float) -> datetime:
    """Seconds since 1970 as a time in UTC."""
    return datetime.fromtimestamp(time, UTC)


def _parquet(table: Table) -> bytes:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise missing_extra("Parquet needs", "pyarrow", "export", ", or write .csv") from None
    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.columns)
    sink = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(
        pyarrow.table({n: list(c) for n, c in zip(table.columns, columns, strict=True)}), sink
    )
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value
