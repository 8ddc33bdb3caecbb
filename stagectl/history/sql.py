"""The history in SQL, for SQLite and PostgreSQL alike."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from stagectl.errors import StagectlError
from stagectl.history.cells import (
    date,
    figures,
    number,
    optional_number,
    optional_text,
    place,
    reads,
    text,
)
from stagectl.history.database import Database
from stagectl.history.records import (
    EstimateRecord,
    Pair,
    RunEntry,
    StageKey,
    StepRecord,
    Wear,
)
from stagectl.history.sql_maps import ESTIMATES, PLACES, RUNS, insert_into
from stagectl.history.sql_runs import SqlRuns
from stagectl.history.sql_series import FAR, covariance, micrometres

_ESTIMATE = (
    "e.run, e.axis, e.kind, e.site, p.x_um, p.y_um, e.time, e.distance, e.accepted, e.reason, "
    "e.figures, e.covariance, e.level, e.measured, e.measured_sigma, e.temperature"
)
_ROW = (
    "run place axis kind site time distance accepted reason figures covariance level "
    "measured measured_sigma temperature number"
).split()
"""Columns of an estimate, in the order of `History._row`."""


class History(SqlRuns):
    """Friction of any number of stages over time and place.

    Every method that writes is one transaction. All methods raise `StagectlError` where the
    database cannot be reached or refuses.

    Args:
        database: with the latest tables of `schema`.
    """

    def __init__(self, database: Database) -> None:
        super().__init__(database)
        self._places: dict[tuple[int, int, int], int] = {}
        self._stage_of_run: dict[int, int] = {}

    def start_run(self, run: RunEntry) -> int:
        """Enter a run, unless its uuid exists already; returns its number."""
        with self._database.transaction():
            stage = self._stage_number(run.stage)
            row = {name: value for name, value in asdict(run).items() if name != "axes"}
            rows = self._insert("run", "id", **{**row, "stage": stage})
            if not rows:
                rows = self._database.execute("SELECT id FROM run WHERE uuid = ?", (run.uuid,))
            for axis in run.axes:
                self._insert("stage_axis", stage=stage, axis=axis)
        number = int(rows[0][0])
        self._stage_of_run[number] = stage
        return number

    def end_run(
        self, run: int, outcome: str | None, fault: str | None = None, estimates: int | None = None
    ) -> None:
        """Enter how a run ended.

        Args:
            run: its number.
            outcome: None where it was killed.
            fault: its text.
            estimates: number made, all of them filed; None: some may be missing.
        """
        with self._database.transaction():
            self._database.execute(
                "UPDATE run SET outcome = ?, fault = ?, estimates = ? WHERE id = ?",
                (outcome, fault, estimates, run),
            )

    @reads
    def unfiled(self, stage: StageKey, last: int = 20) -> list[tuple[str, str]]:
        """Uuid and folder of runs with estimates that may be missing, newest first."""
        newest = "AND r.uuid IS NOT NULL AND r.estimates IS NULL ORDER BY r.id DESC LIMIT ?"
        rows = self._of_stage(stage, f"SELECT r.uuid, r.folder {RUNS}", newest, last)
        return [(text(uuid, "uuid"), text(folder, "folder")) for uuid, folder in rows]

    @reads
    def filed(self, run: int) -> int:
        """Number of estimates of a run."""
        rows = self._database.execute("SELECT count(*) FROM estimate WHERE run = ?", (run,))
        return int(rows[0][0])

    def add(self, estimates: Sequence[EstimateRecord]) -> None:
        """Add estimates, accepted or refused, all or none; existing numbers are kept."""
        made: dict[tuple[int, int, int], int] = {}
        with self._database.transaction():
            rows = [self._row(estimate, made) for estimate in estimates]
            self._database.execute_many(insert_into("estimate", _ROW), rows)
        self._places |= made  # committed

    @reads
    def stages(self) -> list[StageKey]:
        """All stages in the history."""
        rows = self._database.execute("SELECT machine, simulated FROM stage ORDER BY id")
        return [StageKey(text(machine, "machine"), bool(simulated)) for machine, simulated in rows]

    @reads
    def at_date(self, stage: StageKey, when: float) -> list[EstimateRecord]:
        """The last accepted estimate of each place and axis until `when` [s since 1970]."""
        rows = self._database.execute(
            # One index look-up per place and axis, however long the history is.
            f"SELECT {_ESTIMATE} {PLACES} "  # noqa: S608
            "JOIN stage_axis a ON a.stage = s.id JOIN estimate e ON e.id = ("
            "SELECT l.id FROM estimate l WHERE l.place = p.id "
            "AND l.axis = a.axis AND l.accepted = 1 AND l.time <= ? ORDER BY l.time DESC LIMIT 1) "
            "WHERE s.machine = ? AND s.simulated = ? ORDER BY e.axis, p.y_um, p.x_um",
            (min(when, FAR), stage.machine, int(stage.simulated)),
        )
        return [_estimate(row) for row in rows]

    @reads
    def calibrated(self, stage: StageKey) -> list[tuple[Pair, float]]:
        """Places, with the time of their last successful calibration."""
        mine = (stage.machine, int(stage.simulated))
        rows = self._database.execute(
            "SELECT x_um, y_um, max(time) FROM ("
            "SELECT p.x_um, p.y_um, e.time FROM run r JOIN stage s ON s.id = r.stage "
            "JOIN estimate e ON e.run = r.id JOIN place p ON p.id = e.place WHERE s.machine = ? "
            "AND s.simulated = ? AND r.purpose = 'calibration' AND e.accepted = 1 "
            "AND e.measured IS NOT NULL "
            # Slipped into a production run, in which all other moves have a site.
            "UNION ALL SELECT p.x_um, p.y_um, e.time FROM place p JOIN stage s ON s.id = p.stage "
            "JOIN estimate e ON e.place = p.id WHERE s.machine = ? AND s.simulated = ? "
            "AND e.kind = 'other' AND e.site IS NULL AND e.accepted = 1 "
            "AND e.measured IS NOT NULL AND EXISTS (SELECT 1 FROM estimate o "
            "WHERE o.run = e.run AND o.site IS NOT NULL)) AS c GROUP BY x_um, y_um",
            (*mine, *mine),
        )
        return [(place(x, y), date(time)) for x, y, time in rows]

    @reads
    def refused(self, stage: StageKey, last: int = 100) -> list[EstimateRecord]:
        """The last refused estimates, newest first."""
        newest = "AND e.accepted = 0 ORDER BY e.time DESC, e.id DESC LIMIT ?"
        rows = self._of_stage(stage, f"SELECT {_ESTIMATE} {ESTIMATES}", newest, last)
        return [_estimate(row) for row in rows]

    @reads
    def wear(self, stage: StageKey, axis: str, since: float, until: float = math.inf) -> Wear:
        """Moves and distance of an axis after `since`, counting moves with an estimate."""
        select = f"SELECT count(*), coalesce(sum(e.distance), 0) {ESTIMATES}"
        between = "AND e.axis = ? AND e.time > ? AND e.time <= ?"
        times = (max(since, -FAR), min(until, FAR))
        rows = self._of_stage(stage, select, between, axis, *times)
        return Wear(int(rows[0][0]), float(rows[0][1]))

    def add_step(self, step: StepRecord) -> None:
        """Add a step of the level, unless its number exists already."""
        with self._database.transaction():
            rows = self._database.execute("SELECT stage FROM run WHERE id = ?", (step.run,))
            where = self._place((rows[0][0], *micrometres(step.place)))
            self._insert("level_step", **{**asdict(step), "place": where})

    @reads
    def steps(self, stage: StageKey, since: float = -math.inf) -> list[StepRecord]:
        """Steps of the level in order of time."""
        select = (
            "SELECT l.run, l.axis, p.x_um, p.y_um, l.time, l.change, l.kind FROM level_step l "
            "JOIN place p ON p.id = l.place JOIN stage s ON s.id = p.stage"
        )
        after = "AND l.time > ? ORDER BY l.time, l.id"
        rows = self._of_stage(stage, select, after, max(since, -FAR))
        return [
            StepRecord(
                int(r[0]), text(r[1], "axis"), place(r[2], r[3]), date(r[4]),
                number(r[5], "change"), text(r[6], "kind"),
            )
            for r in rows
        ]  # fmt: skip

    @reads
    def counted(self, stage: StageKey) -> tuple[int, int]:
        """Numbers of accepted and refused estimates."""
        select = f"SELECT e.accepted, count(*) {ESTIMATES}"
        counts = dict(self._of_stage(stage, select, "GROUP BY e.accepted"))
        return int(counts.get(1, 0)), int(counts.get(0, 0))

    def close(self) -> None:
        """Close it; idempotent."""
        self._database.close()

    def _place(self, key: tuple[int, int, int]) -> int:
        stage, x, y = key
        return self._id("place", stage=stage, x_um=x, y_um=y)

    def _row(self, e: EstimateRecord, made: dict[tuple[int, int, int], int]) -> tuple[object, ...]:
        stage = self._stage_of_run.get(e.run)
        if stage is None:
            rows = self._database.execute("SELECT stage FROM run WHERE id = ?", (e.run,))
            if not rows:
                raise StagectlError(f"{self.name}: there is no run {e.run}")
            stage = self._stage_of_run[e.run] = int(rows[0][0])
        key = (stage, *micrometres(e.place))
        where = self._places.get(key) or made.get(key)
        if where is None:
            where = made[key] = self._place(key)
        measured = e.measured or (None, None)
        return (
            e.run, where, e.axis, e.kind, e.site, e.time, e.distance, int(e.accepted), e.reason,
            json.dumps(dict(e.figures)), struct.pack(f"<{len(e.covariance)}d", *e.covariance),
            e.level, *measured, e.temperature, e.number,
        )  # fmt: skip


def _estimate(row: Sequence[Any]) -> EstimateRecord:
    shown = None
    if row[13] is not None:
        shown = (number(row[13], "measured"), number(row[14], "measured_sigma"))
    return EstimateRecord(
        run=int(row[0]), axis=text(row[1], "axis"), kind=text(row[2], "kind"),
        site=None if row[3] is None else int(row[3]), place=place(row[4], row[5]),
        time=date(row[6]), distance=number(row[7], "distance"), accepted=bool(row[8]),
        reason=optional_text(row[9], "reason"), figures=figures(row[10]),
        covariance=covariance(row[11]), level=number(row[12], "level"), measured=shown,
        temperature=optional_number(row[15], "temperature"),
    )  # fmt: skip
