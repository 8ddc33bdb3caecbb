"""Tables of the friction history as numbered migrations; a released one is never changed.

The same for SQLite and PostgreSQL: {key}, {real} and {blob} stand for their types of a row number,
a double and bytes. docs/formats/history.md explains every column.
"""

from __future__ import annotations

APPLICATION_ID = 0x53544743
"""`PRAGMA application_id` of a stage.db: "STGC"."""

MIGRATIONS: tuple[tuple[str, ...], ...] = (
    # 1: runs and estimates.
    (
        """CREATE TABLE stage (
            id {key}, machine TEXT NOT NULL, simulated INTEGER NOT NULL,
            UNIQUE (machine, simulated))""",
        """CREATE TABLE stage_axis (
            stage BIGINT NOT NULL REFERENCES stage, axis TEXT NOT NULL, UNIQUE (stage, axis))""",
        """CREATE TABLE run (
            id {key}, stage BIGINT NOT NULL REFERENCES stage, purpose TEXT NOT NULL,
            started {real} NOT NULL, recipe TEXT NOT NULL, lot TEXT, wafer TEXT,
            software TEXT NOT NULL, folder TEXT NOT NULL, seed BIGINT, outcome TEXT, fault TEXT)""",
        """CREATE TABLE place (
            id {key}, stage BIGINT NOT NULL REFERENCES stage,
            x_um BIGINT NOT NULL, y_um BIGINT NOT NULL, UNIQUE (stage, x_um, y_um))""",
        """CREATE TABLE estimate (
            id {key}, run BIGINT NOT NULL REFERENCES run, place BIGINT NOT NULL REFERENCES place,
            axis TEXT NOT NULL, kind TEXT NOT NULL, site BIGINT, time {real} NOT NULL,
            distance {real} NOT NULL, accepted INTEGER NOT NULL, reason TEXT,
            figures TEXT NOT NULL, covariance {blob} NOT NULL, level {real} NOT NULL,
            measured {real}, measured_sigma {real}, temperature {real})""",
        # For trends and maps at a date, neither of which reads refused estimates.
        """CREATE INDEX estimate_trend ON estimate (place, axis, time)
            WHERE accepted = 1""",
        "CREATE INDEX estimate_run ON estimate (run)",
        "CREATE INDEX estimate_time ON estimate (time)",
        "CREATE INDEX run_stage ON run (stage, started)",
    ),
    # 2: maps with their versions, steps of the level.
    (
        """CREATE TABLE friction_map (
            id {key}, stage BIGINT NOT NULL REFERENCES stage, number BIGINT NOT NULL,
            made {real} NOT NULL, comment TEXT NOT NULL, content TEXT NOT NULL,
            UNIQUE (stage, number))""",
        # The last row of a stage names its active map; number is NULL for none.
        """CREATE TABLE activation (
            id {key}, stage BIGINT NOT NULL REFERENCES stage, number BIGINT, time {real} NOT NULL,
            reason TEXT NOT NULL)""",
        """CREATE TABLE level_step (
            id {key}, run BIGINT NOT NULL REFERENCES run, place BIGINT NOT NULL REFERENCES place,
            axis TEXT NOT NULL, time {real} NOT NULL, change {real} NOT NULL,
            kind TEXT NOT NULL)""",
        "CREATE INDEX level_step_time ON level_step (time)",
    ),
    # 3: indices for what a run needs before it begins, however long the history is.
    (
        """CREATE INDEX estimate_measured ON estimate (place, axis, time)
            WHERE measured IS NOT NULL""",
        """CREATE INDEX estimate_slipped ON estimate (place, time)
            WHERE kind = 'other' AND site IS NULL""",
    ),
    # 4: identity of runs and estimates, so that filing them again adds nothing.
    (
        "ALTER TABLE run ADD COLUMN uuid TEXT",
        "ALTER TABLE run ADD COLUMN estimates BIGINT",
        "ALTER TABLE estimate ADD COLUMN number BIGINT",
        "ALTER TABLE level_step ADD COLUMN number BIGINT",
        "CREATE UNIQUE INDEX run_uuid ON run (uuid)",
        """CREATE INDEX run_unfiled ON run (stage)
            WHERE uuid IS NOT NULL AND estimates IS NULL""",
        # Rows of older versions have no number.
        """CREATE UNIQUE INDEX estimate_number ON estimate (run, number)
            WHERE number IS NOT NULL""",
        """CREATE UNIQUE INDEX level_step_number ON level_step (run, number)
            WHERE number IS NOT NULL""",
    ),
    # 5: who ran it, and what they had to say.
    (
        "ALTER TABLE run ADD COLUMN operator TEXT",
        "ALTER TABLE run ADD COLUMN comment TEXT",
    ),
)
READABLE = 2
"""Tables from this version on can be read as they are: later ones only add indices, and columns
needed for writing."""
