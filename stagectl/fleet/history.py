"""Friction of runs from a history, beside the results of a fleet."""

from __future__ import annotations

from contextlib import closing
from datetime import UTC, datetime

from stagectl.fleet.rows import FRICTION, Row, kept_rows, to_parquet
from stagectl.fleet.storage import Folder
from stagectl.history import RunFilter, open_history

FILE = "history.parquet"
_ALL = 10**9


def keep_friction(where: str, folder: Folder) -> int:
    """Read the friction of all runs in a history and keep it with the results.

    Args:
        where: path or address of the history.
        folder: of the results.

    Returns:
        The number of runs and axes.

    Raises:
        UnusableInput: there is no such history, or this version cannot use it.
        StagectlError: it cannot be read.
    """
    rows: list[Row] = []
    with closing(open_history(where)) as history:
        for stage in history.stages():
            for run in history.friction_of_runs(stage, RunFilter(last=_ALL)):
                started = datetime.fromtimestamp(run.entry.started, UTC)
                rows += [
                    {
                        "stage": stage.machine, "simulated": stage.simulated, "axis": axis,
                        "started": started, "coulomb": of.coulomb, "sigma": of.sigma,
                        "source": run.entry.folder,
                    }
                    for axis, of in run.axes.items() if of.coulomb is not None
                ]  # fmt: skip
    folder.write(FILE, to_parquet(rows, FRICTION))
    return len(rows)


def friction_rows(folder: Folder) -> list[Row]:
    """What `keep_friction` has kept; empty without.

    Raises:
        UnusableInput: it is damaged.
    """
    return kept_rows(folder, FILE, FRICTION)
