"""Whole runs on the virtual stage that end soon, or go wrong where a test wants it."""

import json
import math
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np

from stagectl.recipe import parse_recipe
from stagectl.run import Listener, RunRequest, SimulatedStage
from stagectl.sequencer import FrictionUpdated, MoveStarted
from stagedata import FrictionFigures
from tests.short_recipe import short_recipe

HEAD = """\
recipe: short
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
"""
SITES = short_recipe((0.004, -0.003), (0.02, 0.01), (0.0, 0.02), (-0.015, 0.0), (0.01, 0.01))
MOVES = HEAD + (
    "moves: [{to: [0.01, 0.0]}, {reverse: 100 um, axis: x}, {dwell: 50 ms},"
    " {reverse: 200 um, axis: x}, {to: [0.0, 0.005]}]\nfiducial: {source: none}\n"
)
ONE_SITE = short_recipe((0.004, 0.0))
FIGURES = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SIMPLE = FrictionFigures(0, 6.0, 20.0, 0.0, 0.0, 0.4, 2e-3, 1.0, "coulomb")
FOLLOWING, OVER_CURRENT = 0x8611, 0x2310


def request_for(machine, folder, text=ONE_SITE, **changes):
    """To run a recipe on the virtual stage."""
    given = {
        "recipe": parse_recipe(text, "short.yaml", machine), "machine": machine, "folder": folder,
        "started": datetime.now(UTC), "simulated": SimulatedStage(machine),
    }  # fmt: skip
    return RunRequest(**{**given, **changes})


def friction_updated(accepted=True, figures=FIGURES, **changes):
    """What the estimator made of a move."""
    spread = {"coulomb": 0.3, "viscous": 1.0, "stiffness": 6e3, "relaxation_rate": 12.0}
    sigma = {name: value for name, value in spread.items() if figures.has(name)}
    estimate = SimpleNamespace(
        accepted=accepted, reason=None if accepted else "the residual is too large",
        friction=figures, level=1.0, shown=(6.0, 0.03), expected=(6.0, 0.1), zones="AB",
        misfit=0.5, held=("relaxation_rate",), gain=dict.fromkeys(sigma, 0.5),
        figures={name: getattr(figures, name) for name in sigma},
        sigma=sigma, covariance=np.diag(np.square(list(sigma.values()))),
    )  # fmt: skip
    known = {
        "site": 1, "axis": "x", "compute_time": math.nan, "kind": "macro", "place": (0.01, 0.0),
        "distance": 0.01, "time": 1.5, "reach": 0.01,
    }  # fmt: skip
    return FrictionUpdated(estimate=estimate, **{**known, **changes})


def write_summary(folder, **changes):
    """A folder with the summary of a run and nothing else."""
    folder.mkdir(parents=True, exist_ok=True)
    summary = {
        "format": "stagectl-summary", "version": 1, "recipe": "inspection", "machine": "wafer-xy",
        "simulated": True, "lot": None, "fault": None, "outcome": "completed",
        "started": "2026-11-22T08:00:00+00:00", **changes,
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def stopping_at(kind, number):
    """Listens to a run and stops it at an event of this kind: of this site, or of this number."""
    stops = []

    def event(happened):
        if isinstance(happened, kind) and number in (happened.site, getattr(happened, "number", 0)):
            stops[0]("stopped by the operator")

    return Listener(event=event, stoppable=stops.append)


def failing_at(move, code=FOLLOWING, times=1):
    """Listens to a run and has drive y fail in the middle of a move (counted from 1)."""
    stages, begun = [], 0

    def event(happened):
        nonlocal begun
        if isinstance(happened, MoveStarted):
            begun += 1
            if move <= begun < move + times:
                drive, world = stages[0].drives[1], stages[1]
                world.at(world.now_ns + 5_000_000, lambda: drive.inject_fault(code))

    return Listener(event=event, switched_on=lambda *both: stages.extend(both)), stages
