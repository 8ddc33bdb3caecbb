"""A history with calibrations of a table whose friction varies."""

import io
import math
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from stagectl.config import load_machine
from stagectl.history import EstimateRecord, RunEntry, StageKey, open_history
from stagectl.maps import build_map, load_active, map_versions, to_json

STAGE = StageKey("wafer-xy", True)
BEGIN = 1.7e9
GRID = [(x * 0.02 - 0.04, y * 0.02 - 0.04) for y in range(5) for x in range(5)]


@pytest.fixture
def history(tmp_path):
    opened = open_history(str(tmp_path / "stage.db"), write=True)
    yield opened
    opened.close()


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
    number = history.start_run(
        RunEntry(STAGE, ("x", "y"), at, "cal", None, None, "stagectl", "runs/c", "calibration")
    )
    rows = []
    for i, place in enumerate([*sites, sites[0]]):
        for k in range(4):
            for later, axis in enumerate(axes):
                value = level(axis, place) * everywhere * (1.2 if place == spot else 1.0)
                value *= 1.0 - falls * (3 * i + 0.6 * k)
                shown = value * (1.0 + 0.01 * generator.standard_normal())
                when = at + 3 * i + 0.6 * k + 0.1 * later
                rows.append(
                    EstimateRecord(
                        number, axis, "other", i + 1, place, when, 1e-3, True,
                        None, {"coulomb": value, "viscous": 20.0}, (0.01, 0, 0, 0.1), 1.0,
                        (shown, 0.003 * value),
                    )
                )  # fmt: skip
    history.add(rows)
    return number


def keep(history, at):
    built = build_map(history, STAGE, until=at + 1000)
    return history.save_map(STAGE, at, "weekly", to_json(built)), built


def two_versions(history, everywhere=1.0):
    """Two versions of the map: since the first, one site has a fifth more friction."""
    calibrate(history)
    keep(history, BEGIN)
    calibrate(history, at=BEGIN + 5000, spot=GRID[7], everywhere=everywhere, seed=2)
    keep(history, BEGIN + 5000)
    return map_versions(history, STAGE)


@pytest.fixture
def versions(history):
    return two_versions(history)


@pytest.fixture
def warmer(history):
    """The same with the whole table 30 % up."""
    return two_versions(history, everywhere=1.3)


def activated(history, sites, started=BEGIN + 120):
    """The map of a calibration, active in a run that visits these sites."""
    calibrate(history)
    number, _ = keep(history, BEGIN)
    history.activate(STAGE, number, BEGIN, "activated")
    return load_active(history, STAGE, load_machine(), sites, started)


def file(history, started, rows, purpose="production"):
    """A run with these estimates: axis, kind, site, place, time, figures, level shown [N].

    All figures are known to 1 %.
    """
    number = history.start_run(
        RunEntry(STAGE, ("x", "y"), started, "r", None, None, "s", "f", purpose)
    )
    history.add([
        EstimateRecord(
            number, axis, kind, site, place, time, 1e-3, True, None, figures,
            tuple(np.diag([(0.01 * v) ** 2 for v in figures.values()]).ravel().tolist()),
            1.0, shown,
        )
        for axis, kind, site, place, time, figures, shown in rows
    ])  # fmt: skip
    return number


def printed(part):
    """What a terminal of 120 columns shows."""
    console = Console(width=120, file=io.StringIO(), record=True)
    console.print(part, crop=False)
    return console.export_text()


def estimate(shown, zones="AB", misfit=0.6, level=1.0, accepted=True, expected=(6.0, 0.06)):
    """Of a move before which so much was expected [N]."""
    return SimpleNamespace(
        shown=shown, zones=zones, misfit=misfit, accepted=accepted, level=level,
        friction=SimpleNamespace(coulomb=6.0), expected=expected,
    )  # fmt: skip
