"""A history in which somebody else has written: one line, whatever is in which column."""

import contextlib
import shutil
import sqlite3

import pytest

from stagectl.errors import UnusableInput
from stagectl.history import (
    RunFilter,
    StepRecord,
    open_history,
)
from tests.unit.stagectl.rows import BEGIN, STAGE, estimate_record, run_entry

PLACE = (0.01, 0.02)
HOSTILE = ("[/b]\x1b[31m", 1e300, b"\xff\x00")
READS = (
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
def sound(tmp_path_factory):
    path = tmp_path_factory.mktemp("history") / "stage.db"
    opened = open_history(str(path), write=True)
    run = opened.start_run(run_entry(purpose="calibration", seed=1, uuid="u"))
    for k, accepted in enumerate((True, True, False)):
        reason = None if accepted else "too few samples"
        told = {"level": 1.0, "measured": (6.0, 0.1), "temperature": 21.0, "reason": reason}
        opened.add([estimate_record(run, place=PLACE, time=BEGIN + k, accepted=accepted, **told)])
    opened.add_step(StepRecord(run, "x", PLACE, BEGIN, 0.1, "site", 1))
    opened.activate(STAGE, opened.save_map(STAGE, BEGIN, "weekly", "{}"), BEGIN, "activated")
    opened.close()
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
    return path


def columns(path):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        names = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
        for (table,) in names:
            for _, column, *_ in connection.execute(f"PRAGMA table_info({table})").fetchall():
                yield table, column


def spoil(sound, path, table, column, cell):
    """A copy of the history with this cell in every row."""
    shutil.copy(sound, path)
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.execute(f"UPDATE {table} SET {column} = ?", (cell,))  # noqa: S608
        connection.commit()


def texts_in(found):
    """All texts that a reading method gave."""
    if isinstance(found, str):
        yield found
    elif isinstance(found, list | tuple):
        for member in found:
            yield from texts_in(member)
    elif hasattr(found, "__slots__"):
        for name in found.__slots__:
            yield from texts_in(getattr(found, name))


def test_every_hostile_cell_is_one_line_or_does_no_harm(sound, tmp_path):
    path, refused = tmp_path / "stage.db", 0
    for table, column in columns(sound):
        for cell in HOSTILE:
            try:
                spoil(sound, path, table, column, cell)
                history = open_history(str(path))
            except (sqlite3.Error, UnusableInput):  # the table does not take it, or we do not
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


def test_the_line_names_history_column_and_reason(sound, tmp_path):
    path = tmp_path / "stage.db"
    spoil(sound, path, "estimate", "time", 1e300)
    history = open_history(str(path))
    with pytest.raises(UnusableInput, match=r"stage.db: a row of it is damaged: time: 1e\+300 s"):
        history.refused(STAGE)
    history.close()
