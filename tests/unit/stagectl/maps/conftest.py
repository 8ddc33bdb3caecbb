"""A history with calibrations of a table whose friction varies."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from stagectl.config import load_machine
from stagectl.history import open_history
from stagectl.maps import build_map, load_active, map_versions, to_json
from tests.unit.stagectl.rows import BEGIN, STAGE, estimate_record, run_entry

GRID = [(x * 0.02 - 0.04, y * 0.02 - 0.04) for y in range(5) for x in range(5)]


def level(axis, place):
    """The table: +-15 % over some 60 mm."""
    x, y = place
    wave = math.sin(25 * x + 1.0) * math.cos(20 * y) if axis == "x" else math.cos(22 * x - 15 * y)
    return (6.0 if axis == "x" else 9.0) * (1.0 + 0.15 * wave)


def calibrate(
    history, at=BEGIN, spot=None, everywhere=1.0, sites=GRID, seed=1, falls=0.0, axes="xy"
):
    """A calibration as the history has it: four moves a site, 1 % wander."""
    generator = np.random.default_rng(seed)
    number = history.start_run(run_entry(started=at, purpose="calibration"))
    rows = []
    for i, place in enumerate([*sites, sites[0]]):
        for k in range(4):
            for later, axis in enumerate(axes):
                value = level(axis, place) * everywhere * (1.2 if place == spot else 1.0)
                value *= 1.0 - falls * (3 * i + 0.6 * k)
                shown = value * (1.0 + 0.01 * generator.standard_normal())
                when = at + 3 * i + 0.6 * k + 0.1 * later
                figures = {"coulomb": value, "viscous": 20.0}
                rows.append((axis, "other", i + 1, place, when, figures, (shown, 0.003 * value)))
    history.add([row(number, *of, covariance=(0.01, 0, 0, 0.1)) for of in rows])
    return number


def row(run, axis, kind, site, place, time, figures, shown, **other):
    """An estimate: level shown [N]; all figures are known to 1 %, unless `covariance` says else."""
    known = np.diag([(0.01 * value) ** 2 for value in figures.values()]).ravel().tolist()
    values = {
        "axis": axis, "kind": kind, "site": site, "place": place, "time": time, "distance": 1e-3,
        "figures": figures, "covariance": tuple(known), "level": 1.0, "measured": shown, **other,
    }  # fmt: skip
    return estimate_record(run, **values)


def keep(history, at):
    built = build_map(history, STAGE, until=at + 1000)
    return history.save_map(STAGE, at, "weekly", to_json(built)), built


@pytest.fixture(scope="session")
def mapped(tmp_path_factory):
    """A history with two versions of the map, the first in use.

    Since the first one the whole table has 8 % more friction, and one site a fifth more than that.
    """
    history = open_history(str(tmp_path_factory.mktemp("maps") / "stage.db"), write=True)
    calibrate(history)
    keep(history, BEGIN)
    calibrate(history, at=BEGIN + 5000, spot=GRID[7], everywhere=1.08, seed=2)
    keep(history, BEGIN + 5000)
    first, second = map_versions(history, STAGE)
    history.activate(STAGE, 1, BEGIN, "activated")
    yield SimpleNamespace(history=history, first=first, second=second)
    history.close()


def activated(history, sites, started=BEGIN + 120):
    """The map of a calibration, active in a run that visits these sites."""
    calibrate(history)
    number, _ = keep(history, BEGIN)
    history.activate(STAGE, number, BEGIN, "activated")
    return load_active(history, STAGE, load_machine(), sites, started)


def file(history, started, rows, purpose="production"):
    """A run with these estimates, each as `row` takes it."""
    number = history.start_run(run_entry(started=started, purpose=purpose))
    history.add([row(number, *of) for of in rows])
    return number


def estimate(shown, zones="AB", misfit=0.6, level=1.0, accepted=True, expected=(6.0, 0.06)):
    """Of a move before which so much was expected [N]."""
    return SimpleNamespace(
        shown=shown, zones=zones, misfit=misfit, accepted=accepted, level=level,
        friction=SimpleNamespace(coulomb=6.0), expected=expected,
    )  # fmt: skip
