"""Runs and what they have shown of friction, in SQL, for SQLite and PostgreSQL alike."""

from __future__ import annotations

import math
from typing import Any

from stagectl.history.cells import date, figures, number, optional_text, reads, text
from stagectl.history.records import (
    AxisFriction,
    Purpose,
    RunEntry,
    RunFilter,
    RunFriction,
    StageKey,
)
from stagectl.history.sql_maps import RUNS
from stagectl.history.sql_series import FAR, SqlSeries, covariance
from stagectl.plain_text import one_line

_RUN = (
    "r.id, r.started, r.recipe, r.lot, r.wafer, r.software, r.folder, r.purpose, r.seed, r.outcome"
)
_NEWEST = "ORDER BY r.started DESC, r.id DESC LIMIT ?"


class SqlRuns(SqlSeries):
    """The part of `sql.History` that reads runs; arguments as `SqlMaps`."""

    @reads
    def runs(self, stage: StageKey, last: int = 100) -> list[tuple[int, RunEntry, str | None]]:
        """Number, entry and outcome of the last runs, newest first."""
        rows = self._of_stage(stage, f"SELECT {_RUN} {RUNS}", _NEWEST, last)
        axes = self._axes(stage)
        return [(int(row[0]), _entry(stage, axes, row), _outcome(row)) for row in rows]

    @reads
    def friction_of_runs(self, stage: StageKey, wanted: RunFilter) -> list[RunFriction]:
        """The last runs that a filter leaves, newest first, with the friction they have shown."""
        where, values = "", list[object]()
        for column in ("recipe", "lot", "wafer", "purpose"):
            value = getattr(wanted, column)
            if value is not None:
                where += f" AND r.{column} = ?"
                values.append(value)
        where += " AND r.started >= ? AND r.started <= ?"
        values += [max(wanted.since, -FAR), min(wanted.until, FAR), wanted.last]
        rows = self._of_stage(stage, f"SELECT {_RUN} {RUNS}", f"{where} {_NEWEST}", *values)
        axes = self._axes(stage)
        return [
            RunFriction(int(row[0]), _entry(stage, axes, row), _outcome(row), self._friction(row))
            for row in rows
        ]

    def _friction(self, run: tuple[Any, ...]) -> dict[str, AxisFriction]:
        rows = self._database.execute(
            "SELECT axis, count(*), sum(accepted) FROM estimate WHERE run = ? GROUP BY axis "
            "ORDER BY axis",
            (run[0],),
        )
        return {
            text(axis, "axis"): AxisFriction(int(n), int(good), *self._coulomb(run[0], axis))
            for axis, n, good in rows
        }

    def _coulomb(self, run: int, axis: str) -> tuple[float | None, float | None]:
        """The Coulomb force that a run has accepted last, and its standard deviation [N]."""
        rows = self._database.execute(
            "SELECT figures, covariance FROM estimate WHERE run = ? AND axis = ? AND accepted = 1 "
            "ORDER BY time DESC, id DESC LIMIT 1",
            (run, axis),
        )
        known = figures(rows[0][0]) if rows else {}
        if "coulomb" not in known:
            return None, None
        at, variances = list(known).index("coulomb"), covariance(rows[0][1])
        if len(variances) != len(known) ** 2:
            raise ValueError("covariance: is not one of the figures")
        variance = number(variances[at * (len(known) + 1)], "covariance")
        return known["coulomb"], math.sqrt(max(variance, 0.0))

    @reads
    def _axes(self, stage: StageKey) -> tuple[str, ...]:
        select = "SELECT a.axis FROM stage_axis a JOIN stage s ON s.id = a.stage"
        rows = self._of_stage(stage, select, "ORDER BY a.axis")
        return tuple(text(axis, "axis") for (axis,) in rows)


def _entry(stage: StageKey, axes: tuple[str, ...], row: tuple[Any, ...]) -> RunEntry:
    """A run, of the columns `_RUN`."""
    purpose: Purpose = "calibration" if row[7] == "calibration" else "production"
    if row[7] != purpose:
        raise ValueError(f"purpose: is {one_line(repr(row[7]), 40)}")
    return RunEntry(
        stage, axes, date(row[1], "started"), text(row[2], "recipe"),
        optional_text(row[3], "lot"), optional_text(row[4], "wafer"), text(row[5], "software"),
        text(row[6], "folder"), purpose, None if row[8] is None else int(row[8]),
    )  # fmt: skip


def _outcome(row: tuple[Any, ...]) -> str | None:
    return optional_text(row[9], "outcome")
