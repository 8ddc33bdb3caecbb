"""Versions of friction maps in SQL, for SQLite and PostgreSQL alike."""

from __future__ import annotations

from collections.abc import Sequence

from stagectl.history.cells import date, reads, text
from stagectl.history.database import Database
from stagectl.history.records import Activation, StageKey, StoredMap


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
        """Save a new version of the stage's map; returns its number."""
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
        rows = self._database.execute(
            "SELECT m.number, m.made, m.comment, m.content FROM friction_map m "
            "JOIN stage s ON s.id = m.stage WHERE s.machine = ? AND s.simulated = ? "
            "ORDER BY m.number",
            (stage.machine, int(stage.simulated)),
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
        """Make a version the active one; None: no map is active.

        Raises:
            ValueError: there is no such version.
        """
        if number is not None and number not in {m.number for m in self.maps(stage)}:
            raise ValueError(f"there is no map {number} of {stage}")
        with self._database.transaction():
            owner = self._stage_number(stage)
            self._database.execute(
                "INSERT INTO activation (stage, number, time, reason) VALUES (?, ?, ?, ?)",
                (owner, number, time, reason),
            )

    @reads
    def activations(self, stage: StageKey) -> list[Activation]:
        """All activations in order of time."""
        rows = self._database.execute(
            "SELECT a.number, a.time, a.reason FROM activation a JOIN stage s ON s.id = a.stage "
            "WHERE s.machine = ? AND s.simulated = ? ORDER BY a.id",
            (stage.machine, int(stage.simulated)),
        )
        return [
            Activation(None if n is None else int(n), date(time), text(reason, "reason"))
            for n, time, reason in rows
        ]

    def _stage_number(self, stage: StageKey) -> int:
        return self._id("stage", ("machine", "simulated"), (stage.machine, int(stage.simulated)))

    def _id(self, table: str, columns: Sequence[str], values: Sequence[object]) -> int:
        """Number of the row with these values, inserted if necessary."""
        same = " AND ".join(f"{column} = ?" for column in columns)
        rows = self._database.execute(f"SELECT id FROM {table} WHERE {same}", values)  # noqa: S608
        if not rows:
            marks = ", ".join("?" * len(columns))
            rows = self._database.execute(
                f"INSERT INTO {table} ({', '.join(columns)}) VALUES ({marks}) "  # noqa: S608
                f"ON CONFLICT DO NOTHING RETURNING id",
                values,
            ) or self._database.execute(f"SELECT id FROM {table} WHERE {same}", values)  # noqa: S608
        return int(rows[0][0])
