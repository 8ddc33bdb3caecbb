"""A history in which somebody else has written: one line, whatever is in which column."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from stagectl.errors import UnusableInput
from stagectl.history import (
    EstimateRecord,
    History,
    RunEntry,
    RunFilter,
    StageKey,
    StepRecord,
    open_history,
)

STAGE = StageKey("wafer-xy", True)
BEGIN = 1.7e9
PLACE = (0.01, 0.02)
HOSTILE = ("[/b]\x1b[31m", 1e300, b"\xff\x00")
READS: tuple[Callable[[History], object], ...] = (
    lambda h: h.stages(),
    lambda h: h.runs(STAGE),
    lambda h: h.unfiled(STAGE),
    lambda h: h.friction_of_runs(STAGE, RunFilter()),
    lambda h: h.at_date(STAGE, 2e9),
    lambda h: h.calibrated(STAGE),
    lambda h: h.refused(STAGE),
    lambda h: h.wear(STAGE, "x", 0.0),
    lambda h: h.steps(STAGE),
    lambda h: h.counted(STAGE),
    lambda h: h.places(STAGE),
    lambda h: h.newest(STAGE),
    lambda h: h.trend(STAGE, "x", PLACE),
    lambda h: h.measurements(STAGE),
    lambda h: h.measurements(STAGE, each=3, apart=1.0),
    lambda h: h.maps(STAGE),
    lambda h: h.activations(STAGE),
)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("history") / "stage.db"
    opened = open_history(str(path), write=True)
    run = opened.start_run(
        RunEntry(
            STAGE, ("x",), BEGIN, "r", "L", "W", "stagectl", "runs/r", "calibration", 1, "u"
        )
    )  # fmt: skip
    for k, accepted in enumerate((True, True, False)):
        reason = None if accepted else "too few samples"
        opened.add(
            [
                EstimateRecord(
                    run, "x", "other", None, PLACE, BEGIN + k, 1e-3, accepted, reason,
                    {"coulomb": 6.0}, (0.01,), 1.0, (6.0, 0.1), 21.0,
                )
            ]
        )  # fmt: skip
    opened.add_step(StepRecord(run, "x", PLACE, BEGIN, 0.1, "site", 1))
    opened.activate(STAGE, opened.save_map(STAGE, BEGIN, "weekly", "{}"), BEGIN, "activated")
    opened.close()
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA journal_mode = DELETE")
    connection.close()
    return path


def columns(path: Path) -> Iterator[tuple[str, str]]:
    connection = sqlite3.connect(path)
    tables = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
    for (table,) in tables:
        for _, column, *_ in connection.execute(f"PRAGMA table_info({table})").fetchall():
            yield table, column
    connection.close()


def texts_in(found: object) -> Iterator[str]:
    """All texts that a reading method gave."""
    if isinstance(found, str):
        yield found
    elif isinstance(found, list | tuple):
        for member in found:
            yield from texts_in(member)
    elif hasattr(found, "__slots__"):
        for name in found.__slots__:
            yield from texts_in(getattr(found, name))


def test_every_hostile_cell_is_one_line_or_does_no_harm(sound: Path, tmp_path: Path) -> None:
    path, refused = tmp_path / "stage.db", 0
    for table, column in columns(sound):
        for cell in HOSTILE:
            shutil.copy(sound, path)
            connection = sqlite3.connect(path)
            try:
                connection.execute(f"UPDATE {table} SET {column} = ?", (cell,))  # noqa: S608
                connection.commit()
            except sqlite3.Error:  # the table does not take it
                continue
            finally:
                connection.close()
            try:
                history = open_history(str(path))
            except UnusableInput:
                continue
            for read in READS:
                try:
                    found = read(history)
                except UnusableInput as error:
                    refused += str(path) in str(error)
                else:
                    if column != "content":  # of a map, which its own reader judges
                        assert all("\x1b" not in text for text in texts_in(found)), (table, column)
            history.close()
    assert refused > 30


def test_the_line_names_history_column_and_reason(sound: Path, tmp_path: Path) -> None:
    path = tmp_path / "stage.db"
    shutil.copy(sound, path)
    connection = sqlite3.connect(path)
    connection.execute("UPDATE estimate SET time = 1e300")
    connection.commit()
    connection.close()
    history = open_history(str(path))
    with pytest.raises(UnusableInput, match=r"stage.db: a row of it is damaged: time: 1e\+300 s"):
        history.refused(STAGE)
    history.close()
