"""Series of estimates in SQL: the trend of one place, and the measurements of all places.

A production history has millions of rows. What a run needs before it begins is read by index, place
by place, in a time that does not depend on the length of the history.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from stagectl.history.cells import date, figures, number, optional_number, place, reads, text
from stagectl.history.records import Measurement, Pair, StageKey, Trend
from stagectl.history.sql_maps import ESTIMATES, PLACES, SqlMaps
from stagedata import F64

FAR = 1e18  # beyond any time [s]; the databases have no common infinity

_ACCEPTED, _MEASURED = "e.accepted = 1", "e.measured IS NOT NULL"  # as in the indices
_TREND = "e.time, e.figures, e.covariance, e.level, e.temperature, e.kind, e.run"
_LEVEL = "e.time, e.measured, e.measured_sigma"


class SqlSeries(SqlMaps):
    """The part of `sql.History` that reads series; arguments as `SqlMaps`."""

    @reads
    def places(self, stage: StageKey) -> list[Pair]:
        """Places with accepted estimates [m]."""
        known = (
            "AND EXISTS (SELECT 1 FROM estimate e WHERE e.place = p.id AND e.accepted = 1) "
            "ORDER BY p.y_um, p.x_um"
        )
        rows = self._of_stage(stage, f"SELECT p.x_um, p.y_um {PLACES}", known)
        return [place(x, y) for x, y in rows]

    @reads
    def newest(self, stage: StageKey) -> float | None:
        """Time of the last estimate [s since 1970]; None where there is none."""
        select = (
            "SELECT e.time FROM estimate e JOIN run r ON r.id = e.run "
            "JOIN stage s ON s.id = r.stage"
        )
        rows = self._of_stage(stage, select, "ORDER BY e.time DESC LIMIT 1")
        return date(rows[0][0]) if rows else None

    @reads
    def trend(
        self,
        stage: StageKey,
        axis: str,
        place: Pair,
        last: int | None = None,
        apart: float = 0.0,
    ) -> Trend:
        """Accepted estimates of one axis at one place in order of time.

        Args:
            stage: whose.
            axis: its name.
            place: [m].
            last: at most this many, the last ones.
            apart: least time between two of them, counted back from the last one [s].
        """
        here = "AND p.x_um = ? AND p.y_um = ?"
        numbers = self._of_stage(stage, f"SELECT p.id {PLACES}", here, *micrometres(place))
        if not numbers:
            return _trend([])
        key = (int(numbers[0][0]), axis)
        return _trend(self._series(_TREND, _ACCEPTED, key, (-FAR, FAR), last, apart))

    @reads
    def measurements(
        self,
        stage: StageKey,
        since: float = -math.inf,
        until: float = math.inf,
        each: int | None = None,
        apart: float = 0.0,
    ) -> list[Measurement]:
        """Sliding levels measured by moves, in order of time.

        Args:
            stage: whose.
            since: nothing until then [s since 1970].
            until: nothing later.
            each: at most this many of every place and axis, the last ones.
            apart: as in `trend`.
        """
        within = (max(since, -FAR), min(until, FAR))
        if each is None and not apart:
            select = f"SELECT e.axis, p.x_um, p.y_um, {_LEVEL} {ESTIMATES}"
            between = f"AND {_MEASURED} AND e.time > ? AND e.time <= ? ORDER BY e.time, e.id"
            rows = self._of_stage(stage, select, between, *within)
            return [_measurement(*row) for row in rows]
        select = f"SELECT p.id, a.axis, p.x_um, p.y_um {PLACES}"
        axes = "JOIN stage_axis a ON a.stage = s.id"
        keys = self._of_stage(stage, f"{select} {axes}", "ORDER BY p.id, a.axis")
        found = [
            _measurement(axis, x, y, *row)
            for number, axis, x, y in keys
            for row in self._series(_LEVEL, _MEASURED, (number, axis), within, each, apart)
        ]
        return sorted(found, key=lambda entry: entry.time)

    def _series(
        self,
        columns: str,
        which: str,
        key: tuple[int, str],
        within: tuple[float, float],
        last: int | None,
        apart: float,
    ) -> list[tuple[Any, ...]]:
        """The rows of one place and axis after and until the times `within`, in order of time."""
        mine = f"e.place = ? AND e.axis = ? AND {which}"
        if not apart:
            limit = "" if last is None else f" DESC LIMIT {int(last)}"
            rows = self._database.execute(
                f"SELECT {columns} FROM estimate e WHERE {mine} "  # noqa: S608
                f"AND e.time > ? AND e.time <= ? ORDER BY e.time{limit}",
                (*key, *within),
            )
            return rows if last is None else rows[::-1]
        # One index look-up per row.
        before = (
            f"SELECT e.time FROM estimate e WHERE {mine} AND e.time > ? "  # noqa: S608
            "AND e.time <= {} ORDER BY e.time DESC LIMIT 1"
        )
        return self._database.execute(
            f"WITH RECURSIVE back(time, n) AS (SELECT ({before.format('?')}), 1 "  # noqa: S608
            f"UNION ALL SELECT ({before.format('back.time - ?')}), n + 1 FROM back "
            "WHERE n < ? AND back.time IS NOT NULL) "
            f"SELECT {columns} FROM back JOIN estimate e ON {mine} AND e.time = back.time "
            "ORDER BY e.time",
            (*key, *within, *key, within[0], apart, last or 1_000_000, *key),
        )


def micrometres(place: Pair) -> tuple[int, int]:
    """The key of a place: its position in whole um."""
    return round(place[0] * 1e6), round(place[1] * 1e6)


def covariance(data: bytes) -> tuple[float, ...]:
    """Covariance of an estimate, row by row."""
    return struct.unpack(f"<{len(data) // 8}d", data)


def _trend(rows: Sequence[Sequence[Any]]) -> Trend:
    """Rows to columns, vectorised where all rows have the same figures."""
    if not rows:
        none = np.zeros(0)
        return Trend(none, {}, {}, none, none, (), ())
    time, texts, covariances, level, temperature, kind, run = zip(*rows, strict=True)
    entries = [figures(cell) for cell in texts]
    names = list(dict.fromkeys(name for entry in entries for name in entry))
    values = {name: np.array([f.get(name, math.nan) for f in entries], float) for name in names}
    sigma: dict[str, F64]
    if all(entry.keys() == entries[0].keys() for entry in entries):
        count = len(names)
        matrices = np.frombuffer(b"".join(covariances), "<f8").reshape(len(rows), count, count)
        diagonal = np.sqrt(np.maximum(np.einsum("kii->ki", matrices), 0.0))
        sigma = dict(zip(names, diagonal.T, strict=True))
    else:  # another version of the estimator had other figures
        sigma = {name: np.full(len(rows), math.nan) for name in names}
        for k, (entry, data) in enumerate(zip(entries, covariances, strict=True)):
            diagonal = covariance(data)[:: len(entry) + 1]
            for name, variance in zip(entry, diagonal, strict=True):
                sigma[name][k] = math.sqrt(max(variance, 0.0))
    degrees = [optional_number(t, "temperature") for t in temperature]
    return Trend(
        np.array([date(t) for t in time]), values, sigma,
        np.array([number(value, "level") for value in level]),
        np.array([math.nan if t is None else t for t in degrees], float),
        tuple(text(k, "kind") for k in kind), tuple(map(int, run)),
    )  # fmt: skip


def _measurement(
    axis: object, x: object, y: object, time: object, value: object, sigma: object
) -> Measurement:
    return Measurement(
        text(axis, "axis"), place(x, y), date(time), number(value, "measured"),
        number(sigma, "measured_sigma"),
    )  # fmt: skip
