"""Versions of friction maps in SQL, for SQLite and PostgreSQL alike."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from stagectl.history.cells import date, reads, text
from stagectl.history.database import Database
from stagectl.history.records import Activation, StageKey, StoredMap

RUNS = "FROM run r JOIN stage s ON s.id = r.stage"
PLACES = "FROM place p JOIN stage s ON s.id = p.stage"
ESTIMATES = "FROM estimate e JOIN place p ON p.id = e.place JOIN stage s ON s.id = p.stage"


class SqlMaps:
    """The part of `sql.History` that keeps maps.

    Args:
        database: with the latest tables of `schema`.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    @property
    def name(self) -> str:
        """For messages."""
        return self._database.name

    def save_map(self, stage: StageKey, made: float, comment: str, content: str) -> int:
        """Save a new version of the stage's map, made at a time [s]; returns its number."""
        with self._database.transaction():
            owner = self._stage_number(stage)
            rows = self._database.execute(
                "INSERT INTO friction_map (stage, number, made, comment, content) VALUES (?, "
                "(SELECT coalesce(max(number), 0) + 1 FROM friction_map WHERE stage = ?), "
                "?, ?, ?) RETURNING number",
                (owner, owner, made, comment, content),
            )
        return int(rows[0][0])

    @reads
    def maps(self, stage: StageKey) -> list[StoredMap]:
        """All versions in order."""
        select = "SELECT m.number, m.made, m.comment, m.content FROM friction_map m"
        rows = self._of_stage(
            stage, f"{select} JOIN stage s ON s.id = m.stage", "ORDER BY m.number"
        )
        used = self.activations(stage)
        active = used[-1].number if used else None
        return [
            StoredMap(
                int(n), date(made, "made"), text(comment, "comment"), n == active, str(content)
            )
            for n, made, comment, content in rows
        ]

    def activate(self, stage: StageKey, number: int | None, time: float, reason: str) -> None:
        """Make a version the active one from a time [s] on; None: no map is active.

        Raises:
            ValueError: there is no such version.
        """
        if number is not None and number not in {m.number for m in self.maps(stage)}:
            raise ValueError(f"there is no map {number} of {stage}")
        with self._database.transaction():
            owner = self._stage_number(stage)
            self._insert("activation", stage=owner, number=number, time=time, reason=reason)

    @reads
    def activations(self, stage: StageKey) -> list[Activation]:
        """All activations in order of time."""
        select = "SELECT a.number, a.time, a.reason FROM activation a"
        rows = self._of_stage(stage, f"{select} JOIN stage s ON s.id = a.stage", "ORDER BY a.id")
        return [
            Activation(None if n is None else int(n), date(time), text(reason, "reason"))
            for n, time, reason in rows
        ]

    def _of_stage(
        self, stage: StageKey, select: str, rest: str = "", *values: object
    ) -> list[tuple[Any, ...]]:
        """Rows of a stage: `select` has its table as s, `rest` follows the condition on it."""
        return self._database.execute(
            f"{select} WHERE s.machine = ? AND s.simulated = ? {rest}",
            (stage.machine, int(stage.simulated), *values),
        )

    def _stage_number(self, stage: StageKey) -> int:
        return self._id("stage", machine=stage.machine, simulated=int(stage.simulated))

    def _insert(self, table: str, returning: str = "", **row: object) -> list[tuple[Any, ...]]:
        """Insert a row, unless one like it is there; what `returning` names, where it was not."""
        back = f" RETURNING {returning}" if returning else ""
        return self._database.execute(insert_into(table, row) + back, list(row.values()))

    def _id(self, table: str, **row: object) -> int:
        """Number of the row with these values, inserted if necessary."""
        same = " AND ".join(f"{column} = ?" for column in row)
        select = f"SELECT id FROM {table} WHERE {same}"  # noqa: S608
        rows = (
            self._database.execute(select, list(row.values()))
            or self._insert(table, "id", **row)
            or self._database.execute(select, list(row.values()))
        )
        return int(rows[0][0])


def insert_into(table: str, columns: Iterable[str]) -> str:
    """The statement that inserts a row, unless one like it is there."""
    names = list(columns)
    values = f"({', '.join(names)}) VALUES ({', '.join('?' * len(names))})"
    return f"INSERT INTO {table} {values} ON CONFLICT DO NOTHING"
