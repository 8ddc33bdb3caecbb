"""Runs and what they have shown of friction, in SQL, for SQLite and PostgreSQL alike."""

from __future__ import annotations

import json
import math
from typing import Any

from stagectl.history.records import AxisFriction, RunEntry, RunFilter, RunFriction, StageKey
from stagectl.history.sql_series import FAR, SqlSeries, covariance

_RUN = (
    "r.id, r.started, r.recipe, r.lot, r.wafer, r.software, r.folder, r.purpose, r.seed, r.outcome"
)
_OF_STAGE = "FROM run r JOIN stage s ON s.id = r.stage WHERE s.machine = ? AND s.simulated = ?"
_NEWEST = "ORDER BY r.started DESC, r.id DESC LIMIT ?"


class SqlRuns(SqlSeries):
    """The part of `port.History` that reads runs; arguments as `SqlMaps`."""

    def runs(self, stage: StageKey, last: int = 100) -> list[tuple[int, RunEntry, str | None]]:
        """As `port.History`."""
        rows = self._database.execute(
            f"SELECT {_RUN} {_OF_STAGE} {_NEWEST}",
            (stage.machine, int(stage.simulated), last),
        )
        axes = self._axes(stage)
        return [(int(row[0]), RunEntry(stage, axes, *row[1:9]), row[9]) for row in rows]

    def friction_of_runs(self, stage: StageKey, wanted: RunFilter) -> list[RunFriction]:
        """As `port.History`."""
        where, values = "", [stage.machine, int(stage.simulated)]
        for column in ("recipe", "lot", "wafer", "purpose"):
            value = getattr(wanted, column)
            if value is not None:
                where += f" AND r.{column} = ?"
                values.append(value)
        where += " AND r.started >= ? AND r.started <= ?"
        values += [max(wanted.since, -FAR), min(wanted.until, FAR), wanted.last]
        rows = self._database.execute(
            f"SELECT {_RUN} {_OF_STAGE}{where} {_NEWEST}",
            values,
        )
        axes = self._axes(stage)
        return [
            RunFriction(int(row[0]), RunEntry(stage, axes, *row[1:9]), row[9], self._friction(row))
            for row in rows
        ]

    def _friction(self, run: tuple[Any, ...]) -> dict[str, AxisFriction]:
        rows = self._database.execute(
            "SELECT axis, count(*), sum(accepted) FROM estimate WHERE run = ? GROUP BY axis "
            "ORDER BY axis",
            (run[0],),
        )
        return {
            axis: AxisFriction(int(n), int(good), *self._coulomb(run[0], axis))
            for axis, n, good in rows
        }

    def _coulomb(self, run: int, axis: str) -> tuple[float | None, float | None]:
        """The Coulomb force that a run has accepted last, and its standard deviation [N]."""
        rows = self._database.execute(
            "SELECT figures, covariance FROM estimate WHERE run = ? AND axis = ? AND accepted = 1 "
            "ORDER BY time DESC, id DESC LIMIT 1",
            (run, axis),
        )
        figures = json.loads(rows[0][0]) if rows else {}
        if "coulomb" not in figures:
            return None, None
        at = list(figures).index("coulomb")
        variance = covariance(rows[0][1])[at * (len(figures) + 1)]
        return float(figures["coulomb"]), math.sqrt(max(variance, 0.0))

    def _axes(self, stage: StageKey) -> tuple[str, ...]:
        rows = self._database.execute(
            "SELECT a.axis FROM stage_axis a JOIN stage s ON s.id = a.stage "
            "WHERE s.machine = ? AND s.simulated = ? ORDER BY a.axis",
            (stage.machine, int(stage.simulated)),
        )
        return tuple(axis for (axis,) in rows)
